// What the page shows: the header says which arrays lie where in the one compressed block.

const TYPES = { i1: Int8Array, u1: Uint8Array, i2: Int16Array, u2: Uint16Array, i4: Int32Array,
  u4: Uint32Array, f4: Float32Array };

async function readScene() {
  const text = document.getElementById("data").textContent;
  const packed = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const block = await new Response(stream).arrayBuffer();
  const scene = JSON.parse(document.getElementById("header").textContent);
  const frames = scene.times.length;
  for (const solid of scene.solids) solid.mesh = readArray(block, solid.mesh);
  for (const robot of scene.robots) {
    for (const [name, value] of Object.entries(robot)) {
      if (value && value.type) robot[name] = readArray(block, value);
    }
    // Positions and colours are stored as differences of a frame from the one before it.
    robot.motion = addUp(joinPlanes(robot.motion), robot.masses * 3, frames);
    if (robot.actuation) robot.actuation = turned(robot.actuation, robot.springs, frames);
    for (const name of ["stress", "actuation"]) {
      if (robot[name]) robot[name] = addUp(robot[name], robot.springs, frames);
    }
  }
  return scene;
}

function readArray(block, { type, start, count }) {
  const kind = TYPES[type];
  return new kind(block.slice(start, start + count * kind.BYTES_PER_ELEMENT));
}

// All low bytes, then all high bytes: alike bytes side by side compress better.
function joinPlanes(bytes) {
  const count = bytes.length / 2;
  const numbers = new Int16Array(count);
  for (let i = 0; i < count; i++) numbers[i] = bytes[i] | (bytes[count + i] << 8);
  return numbers;
}

// Rows become columns.
function turned(values, rows, columns) {
  const found = new values.constructor(values.length);
  for (let r = 0; r < rows; r++) for (let c = 0; c < columns; c++) found[c * rows + r] = values[r * columns + c];
  return found;
}

function addUp(values, width, frames) {
  for (let i = width; i < width * frames; i++) values[i] += values[i - width];
  return values;
}
