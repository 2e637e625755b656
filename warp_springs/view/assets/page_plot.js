// Plots of a few curves over time: of the chosen robot, or of a run that is going on.

const INK = "#1f2328", GREY = "#8a8d91";
const LAYERS = { kinetic: "#d9822b", gravity: "#6f9bc8", spring: "#b5495b", ground: "#8a8d91" };

class Plot {
  // `seek(share)`, if any, is told where in time somebody pointed.
  constructor(name, seek) {
    this.canvas = document.getElementById(name);
    this.title = document.getElementById(name + "-title");
    if (!seek) return;
    const point = (event) => {
      const box = this.canvas.getBoundingClientRect();
      seek(clamp((event.clientX - box.left - PLOT_LEFT) / (box.width - PLOT_LEFT - 6), 0, 1));
    };
    this.canvas.addEventListener("pointerdown", (event) => { this.canvas.setPointerCapture(event.pointerId); point(event); });
    this.canvas.addEventListener("pointermove", (event) => { if (event.buttons) point(event); });
  }

  // `series`: {name, color, values, kind: "layer" | "line" | "dashed"}; layers are stacked.
  show(title, unit, times, series, note = "", timeUnit = " s") {
    Object.assign(this, { times, series, timeUnit });
    const keys = series.map(({ name, color }) => `<span><i style="background:${color}"></i>${escaped(name)}</span>`);
    this.title.innerHTML = `<b>${escaped(title)}${unit ? ` [${escaped(unit)}]` : ""}</b>` + keys.join("") + (note ? `<span>${escaped(note)}</span>` : "");
    const count = times.length;
    const base = new Float64Array(count);
    let low = 0, high = 0;
    for (const one of series) {
      one.low = one.kind === "layer" ? base.slice() : null;
      if (one.kind === "layer") for (let i = 0; i < count; i++) base[i] += one.values[i];
      one.high = one.kind === "layer" ? base.slice() : one.values;
      for (const v of one.high) if (isFinite(v)) { low = Math.min(low, v); high = Math.max(high, v); }
    }
    Object.assign(this, { low, high: high > low ? high + 0.06 * (high - low) : low + 1 });
    this.image = null;
  }

  draw(share) {
    const { canvas } = this;
    const density = window.devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (!width || !this.series) return;
    const size = { width: Math.round(width * density), height: Math.round(height * density) };
    const c = canvas.getContext("2d");
    if (!this.image || this.image.width !== size.width || this.image.height !== size.height) {
      // The curves are drawn once; what moves with time is only a line over them.
      Object.assign(canvas, size);
      this.image = Object.assign(document.createElement("canvas"), size);
      const still = this.image.getContext("2d");
      still.scale(density, density);
      this.curves(still, width, height);
    }
    c.setTransform(1, 0, 0, 1, 0, 0);
    c.clearRect(0, 0, canvas.width, canvas.height);
    c.drawImage(this.image, 0, 0);
    if (share === null) return;
    c.scale(density, density);
    const x = PLOT_LEFT + share * (width - PLOT_LEFT - 6);
    c.strokeStyle = INK;
    c.lineWidth = 1;
    c.beginPath(); c.moveTo(x, 4); c.lineTo(x, height - PLOT_BOTTOM); c.stroke();
  }

  curves(c, width, height) {
    const { times, low, high } = this;
    const last = times.length - 1;
    const right = width - 6, bottom = height - PLOT_BOTTOM, top = 4;
    const x = (i) => PLOT_LEFT + (last ? (times[i] - times[0]) / (times[last] - times[0]) : 0) * (right - PLOT_LEFT);
    const y = (v) => bottom - (v - low) / (high - low) * (bottom - top);
    c.font = "10px system-ui, 'DejaVu Sans', sans-serif";
    c.fillStyle = GREY;
    c.strokeStyle = "#e3e6ea";
    c.lineWidth = 1;
    c.textAlign = "right"; c.textBaseline = "middle";
    for (const v of ticks(low, high, 4)) {
      c.fillText(short(v), PLOT_LEFT - 5, y(v));
      c.beginPath(); c.moveTo(PLOT_LEFT, y(v)); c.lineTo(right, y(v)); c.stroke();
    }
    c.textAlign = "center"; c.textBaseline = "top";
    for (const t of ticks(times[0], times[last], 4)) {
      const at = PLOT_LEFT + (t - times[0]) / ((times[last] - times[0]) || 1) * (right - PLOT_LEFT);
      c.fillText(short(t) + this.timeUnit, Math.min(at, right - 9), bottom + 4);
    }
    for (const one of this.series) {
      c.beginPath();
      let started = false;
      for (let i = 0; i <= last; i++) {
        if (!isFinite(one.high[i])) continue;
        if (started) c.lineTo(x(i), y(one.high[i])); else c.moveTo(x(i), y(one.high[i]));
        started = true;
      }
      if (one.kind === "layer") {
        for (let i = last; i >= 0; i--) if (isFinite(one.low[i])) c.lineTo(x(i), y(one.low[i]));
        c.fillStyle = one.color;
        c.fill();
        continue;
      }
      c.strokeStyle = one.color;
      c.lineWidth = 1.4;
      c.setLineDash(one.kind === "dashed" ? [4, 3] : []);
      c.stroke();
      c.setLineDash([]);
    }
  }
}

const PLOT_LEFT = 42, PLOT_BOTTOM = 18;

function ticks(low, high, count) {
  const rough = (high - low) / count;
  if (!(rough > 0)) return [low];
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find((n) => n * power >= rough);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
  return found;
}

function short(v) {
  if (v === 0) return "0";
  if (Math.abs(v) >= 1e3 && Math.abs(v) < 1e7) return v.toLocaleString("en");
  return Math.abs(v) >= 1e7 || Math.abs(v) < 1e-3 ? v.toExponential(0) : String(Number(v.toPrecision(3)));
}

function escaped(text) {
  return String(text).replace(/[&<>"]/g, (c) => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" })[c]);
}

// Gravity's energy means something only in differences: where it goes below zero it is counted
// from its lowest value, so that the stack stands on zero.
function energySeries(robot) {
  const series = [];
  for (const [name, color] of Object.entries(LAYERS)) {
    let values = robot["energy_" + name];
    const lowest = values.reduce((a, b) => Math.min(a, b), 0);
    if (lowest < 0) values = values.map((v) => v - lowest);
    series.push({ name: lowest < 0 ? name + " (from its lowest)" : name, color, values, kind: "layer" });
  }
  const total = series[0].values.map((_, i) => series.reduce((sum, one) => sum + one.values[i], 0));
  series.push({ name: "total", color: INK, values: total, kind: "line" });
  series.push({ name: "residual", color: "#7a3fa0", values: robot.energy_residual, kind: "dashed" });
  return series;
}
