// The page: what is shown, and everything that a person can do with it.

const $ = (name) => document.getElementById(name);
const COLORS = ["stress", "material", "actuation"];

class Show {
  constructor(scene) {
    Object.assign(this, { scene, time: 0, playing: true, chosen: 0, everyone: scene.robots.length > 1, last: 0, slow: 0 });
    this.frames = scene.times.length;
    this.painter = new Painter($("view"), scene);
    this.camera = new Camera();
    this.camera.floor = scene.floor;
    this.upper = new Plot("upper", (share) => this.seek(share));
    this.lower = new Plot("lower", (share) => this.seek(share));
    this.labels = scene.robots.length > 1 ? scene.robots.map((robot) => {
      const label = document.createElement("span");
      label.textContent = robot.name;
      return $("labels").appendChild(label);
    }) : [];
    this.fillControls();
    this.choose(0, false);
    this.reset();
    this.play(this.frames > 1);
  }

  get duration() { return this.scene.times[this.frames - 1] - this.scene.times[0]; }

  get moment() {
    const { times } = this.scene;
    const t = times[0] + this.time;
    let a = Math.min(Math.floor(this.time / (this.duration || 1) * (this.frames - 1)), this.frames - 1);
    while (a > 0 && times[a] > t) a--;
    while (a < this.frames - 1 && times[a + 1] <= t) a++;
    const b = Math.min(a + 1, this.frames - 1);
    return { a, b, blend: b > a ? clamp((t - times[a]) / (times[b] - times[a]), 0, 1) : 0 };
  }

  // Where robot `i` is: its box, or with `name` "middle" its centre of mass.
  boxAt({ a, b, blend }, i) {
    const { boxes } = this.scene.robots[i];
    const mix = (k) => boxes[6 * a + k] + blend * (boxes[6 * b + k] - boxes[6 * a + k]);
    return { low: [mix(0), mix(1), mix(2)], high: [mix(3), mix(4), mix(5)] };
  }

  middleAt({ a, b, blend }, i) {
    const { middles } = this.scene.robots[i];
    return [0, 1, 2].map((k) => middles[3 * a + k] + blend * (middles[3 * b + k] - middles[3 * a + k]));
  }

  // What throws shadows: the robots, and the obstacles about them.
  shownBox(moment) {
    const robots = boxAround(this.scene.robots.map((_, i) => this.boxAt(moment, i)));
    const room = Math.hypot(...sub(robots.high, robots.low));
    const near = [0, 1, 2].map((k) => [robots.low[k] - room, robots.high[k] + room]);
    const clipped = (p) => p.map((v, k) => clamp(v, ...near[k]));
    return boxAround([robots, ...this.painter.solids.map(({ low, high }) => ({ low: clipped(low), high: clipped(high) }))]);
  }

  // -- what a person does -------------------------------------------------------------------------

  play(on = !this.playing) {
    this.playing = on && this.frames > 1;
    $("play").querySelector("path").setAttribute("d", this.playing ? "M4 3h4v14H4zM12 3h4v14h-4z" : "M5 3l12 7-12 7z");
    this.wake();
  }

  seek(share) {
    this.play(false);
    this.time = share * this.duration;
    this.goAlong();
    this.wake();
  }

  step(count) {
    this.play(false);
    const { times } = this.scene;
    const { a, blend } = this.moment;
    const here = count < 0 && blend > 1e-3 ? a + 1 : a;
    this.time = times[clamp(here + count, 0, this.frames - 1)] - times[0];
    this.goAlong();
    this.wake();
  }

  choose(i, look = true) {
    const { scene } = this;
    this.chosen = (i + scene.robots.length) % scene.robots.length;
    const robot = scene.robots[this.chosen];
    $("robot").value = this.chosen;
    this.labels.forEach((label, k) => label.classList.toggle("chosen", k === this.chosen));
    const row = ([name, value]) => `<tr class="${name === "stopped" ? "stopped" : ""}"><td>${escaped(name)}</td><td>${escaped(value)}</td></tr>`;
    $("facts").innerHTML = robot.facts.map(row).join("");
    if (robot.energy_kinetic) this.upper.show("energy", "J", scene.times, energySeries(robot));
    else this.upper.show("speed", "m/s", scene.times, [{ name: "centre of mass", color: "#d9822b", values: robot.speed, kind: "line" }],
      "energies were not recorded");
    this.lower.show("height", "m", scene.times, [{ name: "centre of mass", color: "#3a6ea5", values: robot.height, kind: "line" }]);
    this.legend();
    if (look && scene.robots.length > 1) {
      this.everyone = false;
      this.reset();
    }
    this.wake();
  }

  all() {
    this.everyone = true;
    this.reset();
  }

  // What is gone along with: the chosen robot, or the middle of all.
  followedAt(moment) {
    if (!this.everyone) return this.middleAt(moment, this.chosen);
    const middles = this.scene.robots.map((_, i) => this.middleAt(moment, i));
    return scaled(middles.reduce(add), 1 / middles.length);
  }

  // Move the camera as far over the floor as what it follows has moved.
  goAlong() {
    if (!$("follow").checked) return;
    const now = this.followedAt(this.moment);
    const [x, y] = sub(now, this.followed);
    this.camera.target = add(this.camera.target, [x, y, 0]);
    this.followed = now;
  }

  // The box that holds everyone in every frame, seen from the middle of all.
  groupBox() {
    const boxes = this.scene.times.map((_, frame) => {
      const moment = { a: frame, b: frame, blend: 0 };
      const [x, y] = this.followedAt(moment);
      const box = boxAround(this.scene.robots.map((_, i) => this.boxAt(moment, i)));
      return { low: sub(box.low, [x, y, 0]), high: sub(box.high, [x, y, 0]) };
    });
    const [x, y] = this.followedAt(this.moment);
    const { low, high } = boxAround(boxes);
    return { low: add(low, [x, y, 0]), high: add(high, [x, y, 0]) };
  }

  // See everyone, or the chosen robot, and go along.
  reset() {
    const { scene } = this;
    const canvas = $("view");
    Object.assign(this.camera, { azimuth: -1.05, elevation: 0.42 });
    $("follow").checked = true;
    const { moment } = this;
    const box = this.everyone ? this.groupBox() : this.boxAt(moment, this.chosen);
    if (!this.everyone) {  // it is followed along the floor, not up and down
      const { reach } = scene.robots[this.chosen];
      box.low[2] = reach.low[2];
      box.high[2] = reach.high[2];
    }
    this.framed = canvas.clientWidth > 0 && canvas.clientHeight > 0;
    this.camera.frame(box, this.framed ? canvas.clientWidth / canvas.clientHeight : 1);
    if (!this.everyone) this.camera.distance *= 1.35;
    this.followed = this.followedAt(moment);
    this.wake();
  }

  legend() {
    const { scene } = this;
    const robot = scene.robots[this.chosen];
    const color = $("color").value;
    const css = (c) => `rgb(${c.map((v) => Math.round(255 * (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055))).join(" ")})`;
    const { colors } = scene;
    const scale = (low, middle, high, left, right) => {
      $("legend").innerHTML = `<span>${escaped(left)}</span><i style="background:linear-gradient(90deg,${css(low)},${css(middle)},${css(high)})"></i><span>${escaped(right)}</span>`;
    };
    if (color === "stress") scale(colors.compression, colors.neutral, colors.tension, `compression ${short(robot.stressScale)} N`, `tension ${short(robot.stressScale)} N`);
    else if (color === "actuation") scale(colors.shorter, colors.neutral, colors.longer, `shorter ${short(100 * robot.actuationScale)} %`, `longer ${short(100 * robot.actuationScale)} %`);
    else {
      const used = [...new Set(robot.material)].sort((a, b) => a - b);
      $("legend").innerHTML = used.map((m) => `<i class="patch" style="background:${css(scene.materials[m].color)}"></i><span>${escaped(scene.materials[m].name)}</span>`).join("");
    }
  }

  // -- controls -----------------------------------------------------------------------------------

  fillControls() {
    const { scene } = this;
    $("robot").innerHTML = scene.robots.map((robot, i) => `<option value="${i}">${escaped(robot.name)}</option>`).join("");
    $("robot").hidden = $("all").hidden = scene.robots.length < 2;
    const offered = COLORS.filter((name) => name !== "actuation" || scene.robots.some((robot) => robot.actuation));
    $("color").innerHTML = offered.map((name) => `<option>${name}</option>`).join("");
    $("color").value = offered.includes(scene.look.color) ? scene.look.color : "stress";
    $("skin").checked = scene.look.skin;
    $("time").max = this.duration;
    $("play").onclick = () => this.play();
    $("time").oninput = () => this.seek($("time").value / (this.duration || 1));
    $("color").onchange = () => { this.legend(); this.wake(); };
    $("skin").onchange = () => this.wake();
    $("follow").onchange = () => { this.followed = this.followedAt(this.moment); this.wake(); };
    $("robot").onchange = () => this.choose(Number($("robot").value));
    $("all").onclick = () => this.all();
    $("reset").onclick = () => this.reset();
    $("keys").onclick = () => this.help();
    document.addEventListener("keydown", (event) => this.key(event));
    // A frame in another page may be loaded before it has a size.
    new ResizeObserver(() => (this.framed ? this.wake() : this.reset())).observe($("stage"));
    new ResizeObserver(() => this.wake()).observe($("panel"));
    handle($("view"), this);
  }

  help() { $("help").hidden = !$("help").hidden; }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const { tagName } = event.target;
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if (tagName === "SELECT" || (tagName === "BUTTON" && (key === " " || key === "Enter"))) return;
    if (tagName === "INPUT" && (key === " " || key.startsWith("Arrow")) && event.target.type === "checkbox") return;
    const many = event.shiftKey ? 10 : 1;
    const move = (x, y) => (event.shiftKey ? this.camera.pan(-0.06 * x, -0.06 * y) : this.camera.turn(-0.12 * x, 0.08 * y));
    const actions = {
      " ": () => this.play(), ArrowLeft: () => this.step(-many), ArrowRight: () => this.step(many),
      Home: () => this.seek(0), End: () => this.seek(1),
      "-": () => this.faster(1), "+": () => this.faster(-1), "=": () => this.faster(-1),
      n: () => this.choose(this.chosen + 1), p: () => this.choose(this.chosen - 1), a: () => this.all(),
      c: () => { cycle($("color")); this.legend(); }, s: () => $("skin").click(), f: () => $("follow").click(),
      r: () => this.reset(), "?": () => this.help(), Escape: () => { $("help").hidden = true; },
      j: () => move(-1, 0), l: () => move(1, 0), i: () => move(0, 1), k: () => move(0, -1),
      u: () => this.camera.zoom(1 / 1.12), o: () => this.camera.zoom(1.12),
    };
    if (!actions[key]) return;
    event.preventDefault();
    actions[key]();
    this.wake();
  }

  faster(way) {
    const speed = $("speed");
    speed.selectedIndex = clamp(speed.selectedIndex + way, 0, speed.options.length - 1);
  }

  // The robot whose box on the screen holds a point, the nearest of several.
  at(x, y) {
    const canvas = $("view");
    const [w, h] = [canvas.clientWidth, canvas.clientHeight];
    const matrix = this.camera.matrix(w / h);
    let found = -1, nearest = Infinity;
    this.scene.robots.forEach((_, i) => {
      const seen = corners(this.boxAt(this.moment, i)).map((p) => project(matrix, p, w, h));
      const [xs, ys] = [0, 1].map((k) => seen.map((p) => p[k]));
      const depth = Math.min(...seen.map((p) => p[2]));
      const inside = x >= Math.min(...xs) && x <= Math.max(...xs) && y >= Math.min(...ys) && y <= Math.max(...ys);
      if (inside && depth > 0 && depth < nearest) [found, nearest] = [i, depth];
    });
    return found;
  }

  // -- drawing ------------------------------------------------------------------------------------

  wake() {
    if (!this.waiting) this.waiting = requestAnimationFrame((now) => this.tick(now));
  }

  tick(now) {
    this.waiting = 0;
    const passed = this.playing && this.last ? Math.min((now - this.last) / 1000, 0.25) : 0;
    this.last = this.playing ? now : 0;
    if (this.playing) {
      this.time = (this.time + passed * Number($("speed").value)) % (this.duration || 1);
      this.adapt(passed);
    }
    this.draw();
    if (this.playing) this.wake();
  }

  // A slow device gets fewer pixels until it keeps up.
  adapt(passed) {
    this.slow = passed > 0.05 ? this.slow + 1 : Math.max(0, this.slow - 1);
    if (this.slow > 12 && this.painter.sharpness > 0.5) {
      this.painter.sharpness *= 0.8;
      this.slow = 0;
    }
  }

  draw() {
    const { moment } = this;
    this.goAlong();
    const look = { color: $("color").value, skin: $("skin").checked };
    this.painter.draw(this.camera, moment, look, this.shownBox(moment), this.signs(moment));
    $("time").value = this.time;
    $("clock").textContent = (this.scene.times[0] + this.time).toFixed(2) + " s";
    const share = this.duration ? this.time / this.duration : 0;
    this.upper.draw(share);
    this.lower.draw(share);
    this.placeLabels(moment);
    if (!$("stage").classList.contains("drawn")) this.unveil();
  }

  // The sky is seen until the first picture is complete, which takes long without a GPU.
  unveil() {
    if (!this.framed) return;
    if (!this.painter.finished()) return this.wake();
    $("stage").classList.add("drawn");
    if (parent !== window) parent.postMessage("drawn", "*");  // who waited with showing the frame
  }

  // Where mass `i` of a robot is.
  massAt({ a, b, blend }, robot, i) {
    return [0, 1, 2].map((k) => {
      const p = (frame) => robot.motion[(frame * robot.masses + i) * 3 + k];
      return robot.center[k] + robot.quantum * (p(a) + blend * (p(b) - p(a)));
    });
  }

  // Arrows of the pushes that act now, ropes and pegs of the tethers that hold.
  signs(moment) {
    const t = this.scene.times[0] + this.time;
    const found = [];
    this.scene.robots.forEach((robot, r) => {
      const middle = this.middleAt(moment, r);
      for (const push of robot.pushes) {
        if (t < push.start || t > push.end) continue;
        for (const i of push.masses) {
          const at = this.massAt(moment, robot, i);
          // It lies outside the body, where it is seen: it starts at the mass, or it ends there.
          const outwards = dot(push.arrow, sub(at, middle)) >= 0;
          found.push(["arrow", alongMatrix(outwards ? at : sub(at, push.arrow), push.arrow)]);
        }
      }
      for (const { mass, point, start, end } of robot.tethers) {
        if (t < start || t > end) continue;
        const at = this.massAt(moment, robot, mass);
        found.push(["rope", alongMatrix(at, sub(point, at), 0.35 * robot.bar)]);
        found.push(["peg", alongMatrix(point, [0, 0, 0.6 * robot.ball])]);
      }
    });
    return found;
  }

  placeLabels(moment) {
    const canvas = $("view");
    const [w, h] = [canvas.clientWidth, canvas.clientHeight];
    const matrix = this.camera.matrix(w / h);
    const taken = [];
    this.labels.forEach((label, i) => {
      const box = this.boxAt(moment, i);
      const foot = [0.5 * (box.low[0] + box.high[0]), 0.5 * (box.low[1] + box.high[1]), box.low[2]];
      const seen = corners(box).map((p) => project(matrix, p, w, h));
      const [x, middle, depth] = project(matrix, foot, w, h);
      const y = middle + 0.6 * (Math.max(...seen.map((p) => p[1])) - middle) + 3;
      const [half, tall] = [0.5 * label.offsetWidth, label.offsetHeight];
      const spot = [x - half, y, x + half, y + tall];
      const hit = taken.some((o) => spot[0] < o[2] && spot[2] > o[0] && spot[1] < o[3] && spot[3] > o[1]);
      const out = depth <= 0 || x < 0 || x > w || y < 0 || y > h;
      label.style.visibility = hit || out ? "hidden" : "visible";
      label.style.transform = `translate(${(x - half).toFixed(1)}px, ${y.toFixed(1)}px)`;
      if (!hit && !out) taken.push(spot);
    });
  }
}

function cycle(select) {
  select.selectedIndex = (select.selectedIndex + 1) % select.options.length;
}

// Mouse and fingers: one turns, two (or the right button, or shift) move and zoom.
function handle(canvas, show) {
  const fingers = new Map();
  let travelled = 0;
  const middle = () => {
    const all = [...fingers.values()];
    const n = all.length;
    const x = all.reduce((s, p) => s + p.x, 0) / n, y = all.reduce((s, p) => s + p.y, 0) / n;
    return { x, y, spread: Math.hypot(...["x", "y"].map((k) => all[0][k] - all[n - 1][k])) };
  };
  canvas.addEventListener("pointerdown", (event) => {
    if (!fingers.size) travelled = 0;
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!fingers.has(event.pointerId)) return;
    const before = middle();
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    const after = middle();
    const [dx, dy] = [after.x - before.x, after.y - before.y];
    travelled += Math.abs(dx) + Math.abs(dy) + Math.abs(after.spread - before.spread);
    if (fingers.size > 1 || event.buttons & 6 || event.shiftKey) show.camera.pan(dx / canvas.clientHeight, dy / canvas.clientHeight);
    else show.camera.turn(dx * 0.007, dy * 0.007);
    if (fingers.size > 1 && before.spread && after.spread) show.camera.zoom(before.spread / after.spread);
    show.wake();
  });
  const lift = (event) => {
    const tapped = fingers.size === 1 && travelled < 5 && event.type === "pointerup" && !(event.button > 0);
    fingers.delete(event.pointerId);
    if (!tapped) return;
    const box = canvas.getBoundingClientRect();
    const robot = show.at(event.clientX - box.left, event.clientY - box.top);
    if (robot >= 0) show.choose(robot, !show.everyone);
  };
  canvas.addEventListener("pointerup", lift);
  canvas.addEventListener("pointercancel", lift);
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    show.camera.zoom(Math.exp(clamp(event.deltaY, -200, 200) * 0.0015));
    show.wake();
  }, { passive: false });
}

(async () => {
  try {
    if (!window.DecompressionStream) throw new Error("This browser is too old: it cannot unpack the animation (DecompressionStream).");
    new Show(await readScene());
    document.body.dataset.state = "ready";
  } catch (error) {
    $("message").textContent = error.message;
    $("message").hidden = false;
    document.body.dataset.state = "failed";
  }
})();
