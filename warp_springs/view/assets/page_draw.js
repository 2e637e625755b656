// Draws a moment of the scene with WebGL 2: a map of what the sun sees, then the picture.

const SUN = unit([-0.42, -0.62, 1.15]);
const SUN_SPREAD = 0.07;

class Painter {
  constructor(canvas, scene) {
    const gl = canvas.getContext("webgl2", { antialias: true, alpha: false });
    if (!gl) throw new Error("This browser offers no WebGL 2, which the picture needs.");
    Object.assign(this, { gl, canvas, scene, sharpness: 1 });
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    this.programs = {
      bars: this.program(BARS, SURFACE), balls: this.program(BALLS, SURFACE),
      skin: this.program(SKIN, SURFACE), solid: this.program(SOLID, SURFACE),
      barsDepth: this.program(BARS, NOTHING), ballsDepth: this.program(BALLS, NOTHING),
      skinDepth: this.program(SKIN, NOTHING), solidDepth: this.program(SOLID, NOTHING),
      backdrop: this.program(BACKDROP_CORNERS, BACKDROP),
    };
    this.makeShadowMap(Math.min(2048, gl.getParameter(gl.MAX_TEXTURE_SIZE)));
    this.positions = this.texture(scene.robots.map((r) => r.motion), 3, gl.RGB16I, gl.RGB_INTEGER, gl.SHORT);
    this.values = { stress: this.colorTexture("stress"), actuation: this.colorTexture("actuation") };
    this.makeBodies();
    this.solids = scene.solids.map((solid) => this.makeSolid(solid.mesh, scene.colors.obstacle, solid));
    const round = { center: [0, 0, 0] };
    this.signs = {  // of forces
      arrow: this.makeSolid(arrowMesh(), scene.colors.push),
      rope: this.makeSolid(tubeMesh(10), scene.colors.push),
      peg: this.makeSolid(ballMesh(9, 14), scene.colors.push, round),
    };
  }

  program(vertex, fragment) {
    const { gl } = this;
    const program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, COMMON + text);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    const uniforms = {};
    for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); i++) {
      const { name } = gl.getActiveUniform(program, i);
      uniforms[name] = gl.getUniformLocation(program, name);
    }
    return { program, uniforms };
  }

  // Integer arrays one after the other as one texture, `parts` numbers a texel.
  texture(arrays, parts, inner, format, type) {
    const { gl } = this;
    const count = arrays.reduce((sum, a) => sum + a.length, 0) / parts;
    const most = gl.getParameter(gl.MAX_TEXTURE_SIZE);
    const width = Math.min(most, Math.max(256, 2 ** Math.ceil(Math.log2(Math.sqrt(count) || 1))));
    const height = Math.max(1, Math.ceil(count / width));
    if (height > most) throw new Error("This animation is larger than the graphics of this device can hold.");
    const all = new (arrays[0] ? arrays[0].constructor : Int8Array)(width * height * parts);
    let place = 0;
    for (const a of arrays) { all.set(a, place); place += a.length; }
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, inner, width, height, 0, format, type, all);
    this.plain(gl.NEAREST);
    return texture;
  }

  colorTexture(name) {
    const { gl, scene } = this;
    const frames = scene.times.length;
    const arrays = scene.robots.map((r) => r[name] || new Int8Array(r.springs * frames));
    return this.texture(arrays, 1, gl.R8I, gl.RED_INTEGER, gl.BYTE);
  }

  plain(filter) {
    const { gl } = this;
    for (const [name, value] of [[gl.TEXTURE_MIN_FILTER, filter], [gl.TEXTURE_MAG_FILTER, filter],
      [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE]]) {
      gl.texParameteri(gl.TEXTURE_2D, name, value);
    }
  }

  makeShadowMap(size) {
    const { gl } = this;
    this.shadowSize = size;
    this.depths = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.depths);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.DEPTH_COMPONENT24, size, size, 0, gl.DEPTH_COMPONENT, gl.UNSIGNED_INT, null);
    this.plain(gl.NEAREST);
    this.shadowTarget = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.shadowTarget);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, this.depths, 0);
    // The same texture is read in two ways: compared and smoothed, and as it is.
    this.comparing = gl.createSampler();
    gl.samplerParameteri(this.comparing, gl.TEXTURE_COMPARE_MODE, gl.COMPARE_REF_TO_TEXTURE);
    gl.samplerParameteri(this.comparing, gl.TEXTURE_COMPARE_FUNC, gl.LEQUAL);
    for (const way of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) {
      gl.samplerParameteri(this.comparing, way, gl.LINEAR);
    }
    for (const way of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) {
      gl.samplerParameteri(this.comparing, way, gl.CLAMP_TO_EDGE);
    }
  }

  buffer(data) {
    const { gl } = this;
    const buffer = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
    return buffer;
  }

  // One vertex array for each part of each robot.
  makeBodies() {
    const { gl, scene } = this;
    const tube = tubeMesh(10), ball = ballMesh(9, 14);
    const tubeBuffer = this.buffer(tube), ballBuffer = this.buffer(ball);
    const frames = scene.times.length;
    let firstMass = 0, firstSpring = 0;
    this.bodies = scene.robots.map((robot) => {
      const body = { robot, firstMass, firstSpring, tubeCount: tube.length / 3, ballCount: ball.length / 3 };
      firstMass += robot.masses * frames;
      firstSpring += robot.springs * frames;
      const tints = new Uint8Array(robot.springs * 3);
      robot.material.forEach((m, i) => tints.set(bytes(scene.materials[m].color), 3 * i));
      const gone = new Float32Array(robot.springs).fill(frames);
      for (const [spring, frame] of robot.gone) gone[spring] = frame;
      body.bars = this.vertexArray(() => {
        this.attribute(0, tubeBuffer, 3, gl.FLOAT);
        this.attribute(1, this.buffer(new Int32Array(robot.ends)), 2, gl.INT, 1);
        this.attribute(2, this.buffer(tints), 3, gl.UNSIGNED_BYTE, 1);
        this.attribute(3, this.buffer(gone), 1, gl.FLOAT, 1);
      });
      const paints = new Uint8Array(robot.masses * 3);
      const held = new Set(robot.held);
      for (let i = 0; i < robot.masses; i++) paints.set(bytes(held.has(i) ? scene.colors.held : scene.colors.mass), 3 * i);
      body.balls = this.vertexArray(() => {
        this.attribute(0, ballBuffer, 3, gl.FLOAT);
        this.attribute(1, this.buffer(paints), 3, gl.UNSIGNED_BYTE, 1);
      });
      body.skin = this.vertexArray(() => this.attribute(0, this.buffer(new Int32Array(robot.corners)), 1, gl.INT));
      return body;
    });
  }

  // `mesh`: nine numbers a triangle. `at`: the places where it stands. `center`: of a round one.
  makeSolid(mesh, color, { at = [[0, 0, 0]], center = null } = {}) {
    const { gl } = this;
    const normals = center ? Float32Array.from(mesh, (v, i) => v - center[i % 3]) : flatNormals(mesh);
    const array = this.vertexArray(() => {
      this.attribute(0, this.buffer(new Float32Array(mesh)), 3, gl.FLOAT);
      this.attribute(1, this.buffer(normals), 3, gl.FLOAT);
    });
    return { array, count: mesh.length / 3, color, at, ...boundsOf(mesh, at) };
  }

  vertexArray(fill) {
    const array = this.gl.createVertexArray();
    this.gl.bindVertexArray(array);
    fill();
    return array;
  }

  attribute(place, buffer, parts, type, every = 0) {
    const { gl } = this;
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.enableVertexAttribArray(place);
    if (type === gl.INT) gl.vertexAttribIPointer(place, parts, type, 0, 0);
    else gl.vertexAttribPointer(place, parts, type, type === gl.UNSIGNED_BYTE, 0, 0);
    gl.vertexAttribDivisor(place, every);
  }

  // Whether the first picture that was asked for is complete.
  finished() {
    const { gl } = this;
    if (this.fence) return gl.getSyncParameter(this.fence, gl.SYNC_STATUS) === gl.SIGNALED;
    this.fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    return false;
  }

  // `moment`: {a, b, blend} two frames and the way between them; `look`: {color, skin}.
  // `signs`: [kind, matrix] of every arrow, rope and peg.
  draw(camera, moment, look, box, signs) {
    const { gl, canvas, scene } = this;
    const density = Math.min(window.devicePixelRatio || 1, 2) * this.sharpness;
    const width = Math.max(1, Math.round(canvas.clientWidth * density));
    const height = Math.max(1, Math.round(canvas.clientHeight * density));
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    const aspect = width / height;
    const middle = box.low.map((low, k) => 0.5 * (low + box.high[k]));
    const radius = 1.02 * Math.hypot(...sub(box.high, middle)) || 1;
    const sunView = sunMatrix(SUN, middle, radius);
    const tall = Math.min(box.high[2] - (scene.floor ?? box.low[2]), 2 * radius);
    const shared = {
      camera: camera.matrix(aspect), eye: camera.eye, sun: SUN, sunView,
      ...this.distances(camera),
      sunSize: [SUN_SPREAD, 2 * radius, clamp(SUN_SPREAD * 1.2 * tall / (2 * radius), 1.5 / this.shadowSize, 0.06)],
    };
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.shadowTarget);
    gl.viewport(0, 0, this.shadowSize, this.shadowSize);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    // The sun's matrix gives 0 ... 1, a picture wants -1 ... 1.
    const depthView = sunView.map((v, i) => 2 * v - ([3, 7, 11].includes(i) ? 0 : i % 4 < 3 && i > 11 ? 1 : 0));
    depthView[15] = 1;
    this.bind(null);
    this.things("Depth", { camera: depthView }, moment, look, signs);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, width, height);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    this.bind(this.depths);
    this.backdrop(camera, shared, aspect);
    this.things("", shared, moment, look, signs);
  }

  // What becomes of light on its way to the eye.
  distances(camera) {
    const { scene } = this;
    const clear = 5;  // tiles of the floor after which 1 / e of the light comes through water
    return {
      floorAt: [scene.floor ?? 0, scene.tile, 2.2 * camera.distance, 2.6 * camera.distance],
      horizon: scene.colors.sky, water: [...scene.colors.water, clear * scene.tile],
      eyeAbove: scene.water === null ? -1 : camera.eye[2] - scene.water,
    };
  }

  bind(depths) {
    const { gl } = this;
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.positions);
    gl.activeTexture(gl.TEXTURE2);
    gl.bindTexture(gl.TEXTURE_2D, depths);
    gl.bindSampler(2, this.comparing);
    gl.activeTexture(gl.TEXTURE3);
    gl.bindTexture(gl.TEXTURE_2D, depths);
  }

  backdrop(camera, shared, aspect) {
    const { gl, scene } = this;
    const { colors } = scene;
    const { right, up, back } = camera.axes;
    const slope = Math.tan(FIELD_OF_VIEW / 2);
    this.use("backdrop", {
      ...shared, right: scaled(right, slope * aspect), up: scaled(up, slope), back,
      hasFloor: scene.floor !== null, light: colors.groundLight, dark: colors.groundDark, zenith: colors.zenith,
    });
    gl.bindVertexArray(null);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 3);
  }

  things(kind, shared, moment, look, signs) {
    const { gl, scene } = this;
    const { colors } = scene;
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D, this.values[look.color] || this.values.stress);
    const ends = look.color === "actuation" ? [colors.longer, colors.shorter] : [colors.tension, colors.compression];
    for (const body of this.bodies) {
      const { robot } = body;
      const at = (first, count) => [first + moment.a * count, first + moment.b * count];
      const own = { ...shared, frame: at(body.firstMass, robot.masses), blend: moment.blend,
        place: [...robot.center, robot.quantum] };
      const value = look.color === "material" ? [-1, -1] : at(body.firstSpring, robot.springs);
      if (robot.springs) {
        this.use("bars" + kind, { ...own, value, now: moment.a + moment.blend, radius: robot.bar, neutral: colors.neutral,
          levels: scene.levels, positive: ends[0], negative: ends[1], gloss: 0.25 });
        gl.bindVertexArray(body.bars);
        gl.drawArraysInstanced(gl.TRIANGLES, 0, body.tubeCount, robot.springs);
      }
      this.use("balls" + kind, { ...own, radius: robot.ball, gloss: 0.35 });
      gl.bindVertexArray(body.balls);
      gl.drawArraysInstanced(gl.TRIANGLES, 0, body.ballCount, robot.masses);
      if (look.skin && robot.corners.length) {
        this.use("skin" + kind, { ...own, paint: colors.skin, gloss: 0.08 });
        gl.bindVertexArray(body.skin);
        gl.drawArrays(gl.TRIANGLES, 0, robot.corners.length);
      }
    }
    for (const solid of this.solids) for (const at of solid.at) this.solid(kind, shared, solid, moved(at));
    for (const [sign, turn] of signs) this.solid(kind, shared, this.signs[sign], turn);
  }

  solid(kind, shared, solid, turn) {
    this.use("solid" + kind, { ...shared, turn, paint: solid.color, gloss: 0.1 });
    this.gl.bindVertexArray(solid.array);
    this.gl.drawArrays(this.gl.TRIANGLES, 0, solid.count);
  }

  // Take a program and give it what it asks for.
  use(name, values) {
    const { gl } = this;
    const { program, uniforms } = this.programs[name];
    gl.useProgram(program);
    for (const [key, where] of Object.entries(uniforms)) {
      if (key in UNITS) gl.uniform1i(where, UNITS[key]);
      else if (key === "frame" || key === "value") gl.uniform2iv(where, values[key]);
      else if (typeof values[key] === "boolean") gl.uniform1i(where, values[key]);
      else if (typeof values[key] === "number") gl.uniform1f(where, values[key]);
      else if (values[key].length === 16) gl.uniformMatrix4fv(where, false, values[key]);
      else gl[`uniform${values[key].length}fv`](where, values[key]);
    }
  }
}

const UNITS = { positions: 0, values: 1, shadow: 2, depths: 3 };

function bytes(color) {
  return color.map((c) => Math.round(255 * c));
}

function moved([x, y, z]) {
  return new Float32Array([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, y, z, 1]);
}
