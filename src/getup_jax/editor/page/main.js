// The page: connects the store, the server, the curves and the views.

import { Controls } from "./controls.js";
import { Files } from "./files.js";
import { Latency } from "./latency.js";
import { Link } from "./link.js";
import { Panels } from "./panels.js";
import { Player } from "./player.js";
import { Report } from "./report.js";
import { Simulations } from "./simulations.js";
import { Store } from "./store.js";
import { Strip } from "./strip.js";
import { Tabs } from "./tabs.js";
import { watchTheme } from "./theme.js";
import { View } from "./view.js";

const $ = (id) => document.getElementById(id);
const store = new Store();
const link = new Link();
const simulations = new Simulations(link, store);
const due = { curves: false, strip: false }; // to be drawn again
let scene = null, view = null, strip = null, faced = "";

const model = {
  store, motions: simulations.motions,
  time: () => player.time,
  span: () => (scene && store.variants.length ? store.curve.durations[0] + scene.stand_time_s : 1),
  get controlDt() { return scene?.control_dt ?? 0; },
  band: () => scene?.bands[$("band").value],
};

const report = new Report({ verdict: $("verdict"), scores: $("scores"), latency: $("latency") });
const latency = new Latency((first, whole) => report.latency(first, whole, model.span()));
const panels = new Panels($("panels"), model, (time) => player.seek(time));
const player = new Player({ play: $("play"), scrub: $("scrub"), clock: $("clock"), speed: $("speed"), loop: $("loop") }, model, showFrame);
const tabs = new Tabs($("variants"), store, (slot) => simulations.remove(slot));
const ids = ["curve", "band", "start", "region", "place", "duration", "seconds", "shift", "name", "undo", "redo", "reset", "mirror"];
const controls = new Controls(Object.fromEntries(ids.map((id) => [id, $(id)])), store, () => panels.draw());
const files = new Files({
  link, store, say, taken,
  elements: { save: $("save"), open: $("open"), import: $("import"), export: $("export"), curveFile: $("file-curve"), motionFile: $("file-motion") },
});

// From the server.

link.addEventListener("status", ({ detail }) => { veil(detail.text); connected(true); });
link.addEventListener("ready", ({ detail }) => ready(detail.scene));
link.addEventListener("lost", ({ detail }) => {
  connected(false);
  const reason = detail.reason ? ` (${detail.reason})` : "";
  $("banner").textContent = `The connection is lost${reason}. Your edits are kept; connecting again …`;
});
link.addEventListener("error", ({ detail }) => say(detail.text, true));

function connected(there) {
  $("banner").hidden = there;
  $("dot").className = there ? "dot ok" : "dot";
  $("dot").setAttribute("aria-label", there ? "connected" : "not connected");
}

function ready(description) {
  connected(true);
  scene = description;
  veil("");
  $("export").querySelector("[value=mp4]").disabled = !scene.film;
  $("export").querySelector("[value=mp4]").title = scene.film ? "" : "needs pip install 'getup-jax[video]'";
  try {
    view ??= new View($("view"), scene);
    strip ??= new Strip($("strip"), scene, view.software);
  } catch {
    veil("This browser has no WebGL: curves, scores and exports work, the 3-D view does not.");
  }
  controls.fill(scene);
  simulations.begin(scene);
  store.begin(scene.curves[0]);
}

simulations.addEventListener("asked", ({ detail: { slot, request } }) => {
  strip?.cancel(); // of a motion that is no longer asked for
  if (request.released === null || slot !== store.active) return;
  latency.begin(request);
  report.measuring();
  player.restart();
});
simulations.addEventListener("frames", ({ detail: { slot, motion, request, first } }) => {
  due.curves = true;
  if (slot !== store.active || !first) return;
  face(motion);
  latency.came(request, "first");
  if (latency.waits) whenFree(showFrame); // at once: a person waits for it
});
simulations.addEventListener("result", ({ detail: { slot, motion, request } }) => {
  due.curves = true;
  document.body.dataset.shown = request.number;
  if (slot !== store.active) return;
  due.strip = true;
  report.show(motion, scene.match_deg);
  latency.came(request, "whole");
});

// The ground of a new place, and the camera at the side of a new start.
function face(motion) {
  if (!view) return;
  if (JSON.stringify(view.ground ?? null) !== JSON.stringify(motion.ground)) view.setGround(motion.ground);
  const { curve, region, place } = store.current;
  const start = JSON.stringify([curve.start, curve.pose, region, place]);
  if (start === faced) return;
  faced = start;
  view.face(motion.pose(0), scene.links.indexOf("neck"));
}

// From the user.

store.addEventListener("change", ({ detail: { kind, at } }) => {
  if (!scene) return;
  simulations.update(at); // first: the server works while the page draws
  controls.show();
  tabs.draw();
  view?.arrange(store.variants.length, store.active);
  if (kind === "show") report.show(simulations.motions[store.active], scene.match_deg);
  due.curves = true;
  due.strip ||= kind === "show"; // of an edit when its motion is there
});

function taken(curves, name, imported) {
  if (imported) controls.addImported(curves);
  store.choose(curves[0]);
  const [curve] = curves;
  const more = curves.length > 1 ? `; ${curves.length - 1} more under Curve` : "";
  const lengths = curve.durations.length > 1 ? ` (of its durations ${curve.durations.join(", ")} s the middle one)` : "";
  say(`${name}: ${curve.name}${lengths}${more}`);
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
addEventListener("resize", () => { due.strip = true; });
watchTheme($("theme"), () => {
  view?.theme();
  strip?.theme();
  due.strip = true;
});

// To the screen, in every animation frame.

function showFrame() {
  if (!scene) return;
  if (due.curves) panels.draw();
  else if (player.moved) panels.drawTime();
  due.curves = false;
  const pictured = view ? showMotions() : true;
  if (latency.waits && pictured) latency.drawn(view?.fence);
  const shown = simulations.motions[store.active];
  if (due.strip && strip && shown?.result) {
    due.strip = false;
    strip.draw(shown, view.orbit.azimuth, () => !view.fence.waiting);
  }
}

// After the picture at hand, since another one would queue up behind it.
function whenFree(call) {
  if (view) view.fence.then(call);
  else call();
}

// The variants' poses at the player's time; returns whether the view shows them now.
function showMotions() {
  const { motions } = simulations;
  const frame = (motion) => player.frame(motion, scene.control_dt);
  store.variants.forEach((_, slot) => {
    const motion = motions[slot];
    if (motion?.count) view.pose(slot, motion, frame(motion));
    else view.pose(slot, null, 0);
  });
  const active = motions[store.active];
  if (view.follow && active?.count) view.centre(active.pose(frame(active)), 0.12);
  return view.draw(latency.waits);
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
