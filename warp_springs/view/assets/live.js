// Asks once a second how far the run is, and shows it.

const $ = (name) => document.getElementById(name);
const plot = new Plot("curve", null);
const PAUSE = 8000;  // milliseconds that a page of robots stays at least
const PATIENCE = 6000;  // milliseconds after which a page is shown that does not say it has drawn
const SETTLING = 1500;
let shown = 0, changed = 0, failures = 0, coming = null;

function show(state) {
  const words = state.facts.map(([name, value]) => `<div><dt>${escaped(name)}</dt><dd>${escaped(value)}</dd></div>`);
  $("facts").innerHTML = words.join("");
  $("done").value = state.done;
  $("state").textContent = state.words;
  $("state").className = "";
  const { curve } = state;
  const lines = curve.lines.map((line) => ({ ...line, kind: "line", values: line.values.map((v) => (v === null ? NaN : v)) }));
  if (curve.x.length > 1) plot.show(curve.title, curve.unit, curve.x, lines, `against ${curve.xName}`, "");
  plot.draw(null);
  const due = !coming && (!shown || state.done >= 1 || performance.now() - changed > PAUSE);
  if (state.page > shown && due && ($("fresh").checked || !shown)) bring(state.page);
}

// Load a page of robots behind the one that is seen, and show it when it has something to show.
function bring(version) {
  shown = version;
  changed = performance.now();
  const frame = document.createElement("iframe");
  frame.sandbox = "allow-scripts";
  frame.title = "The robots";
  frame.className = "coming";
  frame.src = `robots?${version}`;
  frame.onload = () => setTimeout(() => reveal(frame), PATIENCE);
  coming = frame;
  $("robots").append(frame);
}

// What was seen before stays below until a slow machine has put the new page onto the screen.
function reveal(frame) {
  if (frame !== coming || !frame.className) return;
  frame.className = "";
  setTimeout(() => {
    $("waiting").hidden = true;
    for (const old of $("robots").querySelectorAll("iframe")) if (old !== frame) old.remove();
    coming = null;
  }, SETTLING);
}

window.addEventListener("message", ({ source, data }) => {
  if (data === "drawn" && coming && source === coming.contentWindow) reveal(coming);
});

async function ask() {
  try {
    const answer = await fetch("state", { cache: "no-store" });
    if (!answer.ok) throw new Error(answer.statusText);
    failures = 0;
    show(await answer.json());
  } catch {
    failures += 1;
    if (failures > 1) {
      $("state").textContent = "the run has ended: this page is no longer updated";
      $("state").className = "lost";
    }
  }
  if (failures < 5) setTimeout(ask, 1000);
}

window.addEventListener("resize", () => plot.draw(null));
ask();
