// Vectors are plain arrays of three numbers, matrices columns of a Float32Array(16). z is up.

const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const scaled = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => scaled(a, 1 / (Math.hypot(...a) || 1));
const clamp = (x, low, high) => Math.min(Math.max(x, low), high);

const FIELD_OF_VIEW = 32 * Math.PI / 180;

class Camera {
  constructor() {
    this.azimuth = -1.05;
    this.elevation = 0.42;
    this.distance = 1;
    this.target = [0, 0, 0];
    this.floor = null;  // height below which the eye must not go
  }

  get axes() {
    const [ca, sa, ce, se] = [Math.cos(this.azimuth), Math.sin(this.azimuth),
      Math.cos(this.elevation), Math.sin(this.elevation)];
    const back = [ca * ce, sa * ce, se];
    const right = [-sa, ca, 0];
    return { right, up: cross(back, right), back };
  }

  get eye() {
    const eye = add(this.target, scaled(this.axes.back, this.distance));
    if (this.floor !== null) eye[2] = Math.max(eye[2], this.floor + 0.002 * this.distance);
    return eye;
  }

  // Where it must look, and from how far, to see a box whole.
  frame(box, aspect) {
    this.target = box.low.map((low, k) => 0.5 * (low + box.high[k]));
    const { right, up, back } = this.axes;
    const slope = Math.tan(FIELD_OF_VIEW / 2) / 1.1;
    let distance = 0;
    for (const corner of corners(box)) {
      const p = sub(corner, this.target);
      const reach = Math.max(Math.abs(dot(p, right)) / (slope * aspect), Math.abs(dot(p, up)) / slope);
      distance = Math.max(distance, reach + dot(p, back));
    }
    this.distance = distance || 1;
  }

  turn(dx, dy) {
    this.azimuth -= dx;
    const lowest = this.floor === null ? -1.55 : 0.015;
    this.elevation = clamp(this.elevation + dy, lowest, 1.55);
  }

  // Moves by shares of what the height of the picture shows; up and down stay on the floor.
  pan(dx, dy) {
    const size = 2 * this.distance * Math.tan(FIELD_OF_VIEW / 2);
    const { right } = this.axes;
    const ahead = [-Math.cos(this.azimuth), -Math.sin(this.azimuth), 0];
    const steep = Math.max(Math.sin(this.elevation), 0.25);
    this.target = add(this.target, add(scaled(right, -dx * size), scaled(ahead, dy * size / steep)));
  }

  zoom(factor) {
    this.distance = clamp(this.distance * factor, 1e-3, 1e5);
  }

  // World -> clip space.
  matrix(aspect) {
    const { right, up, back } = this.axes;
    const eye = this.eye;
    const t = 1 / Math.tan(FIELD_OF_VIEW / 2);
    const near = 0.01 * this.distance;
    const far = 400 * this.distance;
    const a = (far + near) / (near - far);
    const b = 2 * far * near / (near - far);
    const rows = [right, up, back];
    const shift = rows.map((row) => -dot(row, eye));
    const m = new Float32Array(16);
    for (let c = 0; c < 4; c++) {
      const [x, y, z] = c < 3 ? rows.map((row) => row[c]) : shift;
      m.set([x * t / aspect, y * t, a * z + (c === 3 ? b : 0), -z], 4 * c);
    }
    return m;
  }
}

// The sun's view of a sphere: world -> 0 ... 1 across, along, and away from the sun.
function sunMatrix(sun, center, radius) {
  const back = unit(sun);
  const right = unit(cross([0, 1, 0], back));
  const up = cross(back, right);
  const m = new Float32Array(16);
  const rows = [right, up, scaled(back, -1)];
  rows.forEach((row, r) => {
    for (let c = 0; c < 3; c++) m[4 * c + r] = row[c] / (2 * radius);
    m[12 + r] = 0.5 - dot(row, center) / (2 * radius);
  });
  m[15] = 1;
  return m;
}

// Where a point of the world is on a canvas of a size: [x, y, depth], depth below 0 behind the eye.
function project(matrix, p, width, height) {
  const [x, y, , w] = [0, 1, 2, 3].map(
    (r) => matrix[r] * p[0] + matrix[4 + r] * p[1] + matrix[8 + r] * p[2] + matrix[12 + r]);
  return [(0.5 + 0.5 * x / w) * width, (0.5 - 0.5 * y / w) * height, w];
}

function corners({ low, high }) {
  return [0, 1, 2, 3, 4, 5, 6, 7].map((i) => [0, 1, 2].map((k) => ((i >> k) & 1 ? high[k] : low[k])));
}

function boxAround(boxes) {
  return {
    low: [0, 1, 2].map((k) => Math.min(...boxes.map((box) => box.low[k]))),
    high: [0, 1, 2].map((k) => Math.max(...boxes.map((box) => box.high[k]))),
  };
}
