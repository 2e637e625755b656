// Meshes as nine numbers a triangle.

function tubeMesh(sides) {
  const mesh = [];
  for (let i = 0; i < sides; i++) {
    const [a, b] = [i, i + 1].map((k) => [Math.cos(2 * Math.PI * k / sides), Math.sin(2 * Math.PI * k / sides)]);
    mesh.push(...a, 0, ...b, 0, ...b, 1, ...a, 0, ...b, 1, ...a, 1);
  }
  return new Float32Array(mesh);
}

function ballMesh(rings, sides) {
  const point = (i, j) => {
    const [t, p] = [Math.PI * i / rings, 2 * Math.PI * j / sides];
    return [Math.sin(t) * Math.cos(p), Math.sin(t) * Math.sin(p), Math.cos(t)];
  };
  const mesh = [];
  for (let i = 0; i < rings; i++) {
    for (let j = 0; j < sides; j++) {
      const [a, b, c, d] = [point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1)];
      if (i < rings - 1) mesh.push(...a, ...b, ...c);
      if (i > 0) mesh.push(...a, ...c, ...d);
    }
  }
  return new Float32Array(mesh);
}

// An arrow of length one from the origin along +z.
function arrowMesh() {
  const mesh = [];
  const sides = 16, shaft = 0.035, head = 0.09, neck = 0.72;
  const ring = (k, r, z) => [r * Math.cos(2 * Math.PI * k / sides), r * Math.sin(2 * Math.PI * k / sides), z];
  for (let k = 0; k < sides; k++) {
    const [a, b, c, d] = [ring(k, shaft, 0), ring(k + 1, shaft, 0), ring(k + 1, shaft, neck), ring(k, shaft, neck)];
    const [e, f] = [ring(k, head, neck), ring(k + 1, head, neck)];
    mesh.push(...a, ...b, ...c, ...a, ...c, ...d, ...e, ...f, 0, 0, 1, 0, 0, neck, ...f, ...e, 0, 0, 0, ...b, ...a);
  }
  return mesh;
}

// The matrix that puts a mesh of length one along +z from a point along a vector, so much as wide.
function alongMatrix(from, vector, wide = Math.hypot(...vector)) {
  const length = Math.hypot(...vector) || 1e-9;
  const z = scaled(vector, 1 / length);
  const x = unit(cross(Math.abs(z[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0], z));
  const y = cross(z, x);
  return new Float32Array([...scaled(x, wide), 0, ...scaled(y, wide), 0, ...vector, 0, ...from, 1]);
}

function flatNormals(mesh) {
  const normals = new Float32Array(mesh.length);
  for (let i = 0; i < mesh.length; i += 9) {
    const [a, b, c] = [0, 3, 6].map((k) => [mesh[i + k], mesh[i + k + 1], mesh[i + k + 2]]);
    const normal = unit(cross(sub(b, a), sub(c, a)));
    for (let k = 0; k < 9; k++) normals[i + k] = normal[k % 3];
  }
  return normals;
}

// The box around a mesh at all its places.
function boundsOf(mesh, at) {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  mesh.forEach((v, i) => { low[i % 3] = Math.min(low[i % 3], v); high[i % 3] = Math.max(high[i % 3], v); });
  return boxAround(at.map((place) => ({ low: add(low, place), high: add(high, place) })));
}
