// The page: connects the store, the server, the curves and the views.

import { Controls } from "./controls.js";
import { Files } from "./files.js";
import { Link } from "./link.js";
import { Motion } from "./motion.js";
import { Panels } from "./panels.js";
import { Player } from "./player.js";
import { Report } from "./report.js";
import { MOST_VARIANTS, Store } from "./store.js";
import { Strip } from "./strip.js";
import { View } from "./view.js";

const $ = (id) => document.getElementById(id);
const store = new Store();
const link = new Link();
const sent = []; // slot -> {text, number, released, first}
const motions = [];
let scene = null, view = null, strip = null, stripDue = false, faced = "";

const model = {
  store, motions,
  time: () => player.time,
  span: () => (scene && store.variants.length ? store.curve.durations[0] + scene.stand_time_s : 1),
  get controlDt() { return scene?.control_dt ?? 0; },
  band: () => scene?.bands[$("band").value],
};

const report = new Report({ verdict: $("verdict"), scores: $("scores"), latency: $("latency") });
const panels = new Panels($("panels"), model, (time) => player.seek(time));
const player = new Player({ play: $("play"), scrub: $("scrub"), clock: $("clock"), speed: $("speed"), loop: $("loop") }, model, showFrame);
const ids = ["curve", "band", "start", "region", "place", "duration", "seconds", "shift", "name", "undo", "redo", "reset", "mirror"];
const controls = new Controls(Object.fromEntries(ids.map((id) => [id, $(id)])), store, () => panels.draw());
const files = new Files({
  link, store, say, taken,
  elements: { save: $("save"), open: $("open"), import: $("import"), export: $("export"), curveFile: $("file-curve"), motionFile: $("file-motion") },
});

// From the server.

link.addEventListener("status", ({ detail }) => { veil(detail.text); connected(); });
link.addEventListener("ready", ({ detail }) => ready(detail.scene));
link.addEventListener("lost", ({ detail }) => {
  $("dot").className = "dot";
  $("dot").setAttribute("aria-label", "not connected");
  const reason = detail.reason ? ` (${detail.reason})` : "";
  $("banner").textContent = `The connection is lost${reason}. Your edits are kept; connecting again …`;
  $("banner").hidden = false;
});
link.addEventListener("error", ({ detail }) => {
  say(detail.text, true);
  const slot = sent.findIndex((s) => s?.number === detail.number);
  if (slot >= 0) sent[slot].failed = true;
});
link.addEventListener("ground", ({ detail }) => {
  if (sent[detail.slot]?.number === detail.number) sent[detail.slot].ground = detail;
});
link.addEventListener("frames", ({ detail }) => addFrames(detail));
link.addEventListener("result", ({ detail }) => addResult(detail));

function connected() {
  $("banner").hidden = true;
  $("dot").className = "dot ok";
  $("dot").setAttribute("aria-label", "connected");
}

function ready(description) {
  connected();
  scene = description;
  veil("");
  $("export").querySelector("[value=mp4]").disabled = !scene.film;
  $("export").querySelector("[value=mp4]").title = scene.film ? "" : "needs pip install 'getup-jax[video]'";
  try {
    view ??= new View($("view"), scene);
    strip ??= new Strip($("strip"), scene);
  } catch {
    veil("This browser has no WebGL: curves, scores and exports work, the 3-D view does not.");
  }
  controls.fill(scene);
  sent.length = 0;
  store.begin(scene.curves[0]);
}

function addFrames(message) {
  const request = sent[message.slot];
  if (request?.number !== message.number) return; // of an older edit
  if (message.first === 0) {
    motions[message.slot] = new Motion(message.number, message.total, scene.links.length);
    motions[message.slot].ground = request.ground ?? null;
  }
  const motion = motions[message.slot];
  motion.add(message);
  if (message.first === 0) firstFrames(message.slot, motion, request);
  if (message.slot === store.active) stripDue = true;
  redraw.due = true;
}

function firstFrames(slot, motion, request) {
  request.arrived = true;
  if (slot === store.active && view) {
    if (JSON.stringify(view.ground ?? null) !== JSON.stringify(motion.ground)) view.setGround(motion.ground);
    const { curve, region, place } = store.current;
    const start = JSON.stringify([curve.start, curve.pose, region, place]);
    if (start !== faced) {
      faced = start;
      view.face(motion.pose(0), scene.links.indexOf("neck"));
    }
  }
  if (request.released !== null) {
    // measured when the frame is on the screen
    requestAnimationFrame(() => {
      request.first = performance.now() - request.released;
      report.latency(request.first, null);
    });
  }
  if (request.due) simulate(slot, false);
}

function addResult(message) {
  const request = sent[message.slot];
  if (request?.number !== message.number) return;
  const motion = motions[message.slot];
  motion.result = message;
  if (request.released !== null) {
    requestAnimationFrame(() => report.latency(request.first ?? 0, performance.now() - request.released, motion.total * scene.control_dt));
  }
  if (message.slot === store.active) report.show(motion, scene.match_deg);
  document.body.dataset.shown = message.number;
  redraw.due = stripDue = true;
}

// From the user.

store.addEventListener("change", ({ detail }) => {
  if (!scene) return;
  controls.show();
  tabs();
  view?.arrange(store.variants.length, store.active);
  motions.length = Math.min(motions.length, store.variants.length);
  sent.length = Math.min(sent.length, store.variants.length);
  store.variants.forEach((_, slot) => simulate(slot, detail === "commit" && slot === store.active));
  if (detail === "show") report.show(motions[store.active], scene.match_deg);
  redraw.due = stripDue = true;
});

// Asks for the motion of a variant if it is another than the last time. While a gesture goes on
// the next request waits for the first frames of the last one.
function simulate(slot, released) {
  const { curve, region, place } = store.variants[slot];
  const text = JSON.stringify([{ ...curve, name: "" }, region, place]);
  const last = sent[slot];
  if (last?.text === text && (!released || last.released !== null)) return;
  if (last && !released && !last.arrived && !last.failed && link.open) {
    last.due = true;
    return;
  }
  if (released && slot === store.active) player.restart();
  const started = released ? performance.now() : null;
  const number = link.send({ type: "simulate", slot, curve, region, place });
  sent[slot] = { text, number, released: started };
}

function taken(curves, name, imported) {
  if (imported) controls.addImported(curves);
  store.choose(curves[0]);
  const [curve] = curves;
  const more = curves.length > 1 ? `; ${curves.length - 1} more under Curve` : "";
  const lengths = curve.durations.length > 1 ? ` (of its durations ${curve.durations.join(", ")} s the middle one)` : "";
  say(`${name}: ${curve.name}${lengths}${more}`);
}

function tabs() {
  const buttons = store.variants.map((_, slot) => {
    const button = document.createElement("button");
    button.textContent = "ABCD"[slot];
    button.className = `swatch${slot}`;
    button.setAttribute("role", "tab");
    button.setAttribute("aria-selected", slot === store.active);
    button.title = slot === store.active ? "The variant that you edit" : "Edit this variant; it is the ghost in the view";
    button.addEventListener("click", () => store.show(slot));
    return button;
  });
  const add = document.createElement("button");
  add.textContent = "+ variant";
  add.title = "A copy to compare with: the others stay as ghosts";
  add.disabled = store.variants.length >= MOST_VARIANTS;
  add.addEventListener("click", () => store.addVariant());
  buttons.push(add);
  if (store.variants.length > 1) {
    const remove = document.createElement("button");
    remove.textContent = "×";
    remove.title = "Remove this variant";
    remove.setAttribute("aria-label", "Remove this variant");
    remove.addEventListener("click", () => {
      motions.splice(store.active, 1);
      sent.splice(store.active, 1);
      store.removeVariant(store.active);
    });
    buttons.push(remove);
  }
  const focused = [...$("variants").children].indexOf(document.activeElement);
  $("variants").replaceChildren(...buttons);
  if (focused >= 0) $("variants").children[Math.min(focused, buttons.length - 1)].focus();
}

document.addEventListener("keydown", (event) => {
  const key = event.key.toLowerCase();
  if ((event.ctrlKey || event.metaKey) && "zys".includes(key)) {
    event.preventDefault();
    if (key === "s") files.save();
    else if (key === "y" || event.shiftKey) store.redo();
    else store.undo();
  } else if (key === " " && !/^(button|input|select)$/i.test(event.target.tagName)) {
    event.preventDefault();
    player.toggle();
  } else if ((key === "," || key === ".") && !/^input$/i.test(event.target.tagName)) {
    player.seek(player.time + (key === "." ? 1 : -1) * (scene?.control_dt ?? 0));
  }
});
$("follow").addEventListener("change", () => { if (view) view.follow = $("follow").checked; });
addEventListener("resize", () => { stripDue = true; });

// The theme: the system's, or the chosen one.

const dark = matchMedia("(prefers-color-scheme: dark)");
function applyTheme() {
  const theme = localStorage.getItem("getup-theme") ?? (dark.matches ? "dark" : "light");
  document.documentElement.dataset.theme = theme;
  view?.theme();
  strip?.theme();
  stripDue = true;
}
dark.addEventListener("change", applyTheme);
$("theme").addEventListener("click", () => {
  localStorage.setItem("getup-theme", document.documentElement.dataset.theme === "dark" ? "light" : "dark");
  applyTheme();
});
applyTheme();

// To the screen.

function redraw() {
  redraw.due = false;
  panels.draw();
}

function showFrame(seconds) {
  if (!scene) return;
  if (redraw.due) redraw();
  panels.drawTime();
  if (!view) return;
  store.variants.forEach((_, slot) => {
    const motion = motions[slot];
    view.pose(slot, motion?.count ? motion.pose(player.frame(motion, scene.control_dt)) : null);
  });
  const shown = motions[store.active];
  if (view.follow && shown?.count) view.centre(shown.pose(player.frame(shown, scene.control_dt)), 0.12);
  view.pace(seconds);
  view.draw();
  if (stripDue && shown?.result) {
    stripDue = false;
    strip.draw(shown, view.orbit.azimuth);
  }
}

function veil(text) {
  $("veil").textContent = text;
  $("veil").hidden = !text;
}

function say(text, bad = false) {
  const toast = $("toast");
  toast.textContent = text;
  toast.className = bad ? "shown bad" : "shown";
  clearTimeout(say.timer);
  say.timer = setTimeout(() => { toast.className = ""; }, bad ? 9000 : 4000);
}
