// The page: connects the store, the server, the curves and the views. What is shown follows from the store
// and the results alone: an edit makes a request, its answer a result, and both are drawn.

import { alike } from "./alike.js";
import { Autosave } from "./autosave.js";
import { reached } from "./contacts.js";
import { duration } from "./content.js";
import { Controls } from "./controls.js";
import { $, write } from "./dom.js";
import { Exports } from "./export.js";
import { Files } from "./files.js";
import { Graph } from "./graph.js";
import { Judging } from "./judging.js";
import { Latency } from "./latency.js";
import { Link } from "./link.js";
import { say } from "./notice.js";
import { Player } from "./player.js";
import { MOST_IMPORTED, project } from "./project.js";
import { Projects } from "./projects.js";
import { recalled, remember } from "./recall.js";
import { Report, wishWords } from "./report.js";
import { Results } from "./results.js";
import { help, listen } from "./shortcuts.js";
import { shortcuts } from "./keyboard.js";
import { Sources } from "./sources.js";
import { Stage } from "./stage.js";
import { Storage } from "./storage.js";
import { Store } from "./store.js";
import { Tabs } from "./tabs.js";
import { watchTheme } from "./theme.js";
import { Tools } from "./tools.js";
import { choose } from "./edits.js";

const store = new Store(), storage = new Storage(), autosave = new Autosave(storage, store, say);
const link = new Link(), results = new Results(link, store), sources = new Sources(link, store);
const due = { curves: false, frames: false, strip: false }; // to be drawn again; frames: soon, since more of them come
const PACE_MS = 100; // between two drawings of the curves while their motion comes in
let drawn = 0; // when the curves were
let there = false; // curves and body have been drawn once
/** @type {any} */
let scene = null;

const model = {
  store, results,
  time: () => player.time,
  span: () => (scene && store.project ? store.longest + scene.stand_time_s : 1),
  get controlDt() { return scene?.control_dt ?? 0; },
  band: () => scene?.bands[$("band").value],
  recording: () => ($("source").checked ? sources.recording : null),
  get range() { return /** @type {[number, number]} */ ([player.from, player.to]); },
  frames: () => graph?.frames ?? false,
};

const report = new Report({ verdict: $("verdict"), scores: $("scores"), latency: $("latency") });
const latency = new Latency((/** @type {number} */ first, /** @type {number | null} */ whole) => report.latency(first, whole, model.span()));
const parts = Object.fromEntries(["play", "scrub", "clock", "speed", "loop", "first", "back", "on", "in", "out", "range"].map((id) => [id, $(id)]));
/** @type {Graph} */
let graph;
const player = new Player(parts, model, showFrame, () => { due.curves = true; });
graph = new Graph($("panels"), model, (time) => player.seek(time));
const tools = new Tools($("tools"), graph, player);
const tabs = new Tabs($("variants"), store);
const ids = ["curve", "band", "start", "region", "place", "duration", "seconds", "shift", "name", "undo", "redo", "reset", "mirror"];
const controls = new Controls(Object.fromEntries(ids.map((id) => [id, $(id)])), store, () => { due.curves = true; });
const judging = new Judging(link, store);
controls.judged = (/** @type {import("./types.js").Curve} */ curve) => judging.of(curve);
judging.addEventListener("change", () => controls.show());
const stage = new Stage(store, results, player, sources);
const projects = new Projects(storage, store, autosave, () => scene.curves[0]);
new Exports(link, store, { scene: () => scene, range: () => model.range, still: () => stage.still() });
const files = new Files(link, store, {
  opened: (curves, file) => taken(curves, file),
  imported(curves, recordings, file) {
    const left = store.addImported(curves.map((curve, i) => ({ curve, file, recording: recordings[i] ?? null })));
    taken(curves, file);
    if (left) say(`${file}: a project holds ${MOST_IMPORTED} imported motions; ${left} of this file are left out. Begin a new project for them.`, true);
  },
  project: (text, file) => projects.import(text, file),
  ground: () => (scene.terrain ? { region: scene.terrain.regions[store.now.region], place: store.now.place + 1 } : {}),
});
const keys = shortcuts({ store, player, tools, graph, files, stage, help: () => help(keys) });
listen(keys);

// From the server.

const opened = storage.open().then(() => autosave.last());
link.addEventListener("status", (/** @type {any} */ { detail }) => { veil(detail.text); connected(true); });
link.addEventListener("ready", (/** @type {any} */ { detail }) => ready(detail.scene));
link.addEventListener("lost", (/** @type {any} */ { detail }) => {
  connected(false);
  const reason = detail.reason ? ` (${detail.reason})` : "";
  $("banner").textContent = `The connection is lost${reason}. Your edits are kept; connecting again …`;
  showReport();
});
link.addEventListener("error", (/** @type {any} */ { detail }) => say(detail.text, true));

/** @param {boolean} there */
function connected(there) {
  $("banner").hidden = there;
  $("dot").className = there ? "dot ok" : "dot";
  $("dot").setAttribute("aria-label", there ? "connected" : "not connected");
}

/** @param {any} description */
async function ready(description) {
  connected(true);
  veil("");
  const last = store.project ?? (await opened);
  scene = description;
  stage.know(scene);
  controls.fill(scene);
  tools.fillPoses(scene);
  results.begin(scene);
  judging.begin();
  if (store.project) return store.tell("show");
  autosave.open(last ?? project(scene.curves[0], "My get-up"), !last);
  // the curves first: the server works while the view is made
  requestAnimationFrame(() => setTimeout(() => {
    if (!stage.begin()) veil("This browser has no WebGL: curves, scores and exports work, the 3-D view does not.");
  }));
  if (!storage.lasting) say("This browser keeps nothing: export the project before you close the page.", true);
}

results.addEventListener("asked", (/** @type {any} */ { detail: { request } }) => {
  stage.strip?.cancel(); // of a motion that is no longer asked for
  showReport();
  if (request.released === null || request.slot !== store.active) return;
  latency.begin(request);
  report.measuring();
  player.restart();
});
results.addEventListener("frames", (/** @type {any} */ { detail: { result, first } }) => {
  due[first ? "curves" : "frames"] = true;
  if (result.slot !== store.active || !first) return;
  showReport();
  stage.face(result);
  latency.came(result, "first");
  if (latency.waits) stage.whenFree(showFrame); // at once: a person waits for it
});
results.addEventListener("result", (/** @type {any} */ { detail: { result } }) => {
  due.curves = true;
  document.body.dataset.shown = result.number;
  if (result.slot !== store.active) return;
  due.strip = true;
  showReport();
  latency.came(result, "whole");
});

// From the user.

store.addEventListener("change", (/** @type {any} */ { detail: { kind, at } }) => {
  if (!scene) return;
  if (kind === "project") begin();
  results.update(at); // first: the server works while the page draws
  sources.update();
  judging.update();
  show();
  due.curves = true;
  due.strip ||= kind === "show" || kind === "project"; // of an edit when its motion is there
  if (kind !== "live") autosave.save();
});

/** Another project: nothing of the last one stays. */
function begin() {
  results.clear();
  graph.picked = {};
  player.setRange(null);
  graph.zoom(null);
}

/** Everything but what animation frames draw. */
function show() {
  controls.show();
  tabs.draw();
  tools.show();
  stage.arrange();
  write($("project"), store.project?.name ?? "Project");
  $("apart-label").hidden = store.variants.length < 2;
  $("source").disabled = !sources.any;
  write($("source-name"), sources.side === "mirrored" ? "Source, mirrored" : "Source");
  showReport();
}

function showReport() {
  if (scene && store.project) report.show(results.active, results.current(store.active), link.open, scene.match_deg, wishes);
}

/** What came of the poses that were wished. */
function wishes() {
  const motion = results.active?.motion, of = { seconds: duration(store.now), dt: scene.control_dt };
  return motion ? store.now.wishes.map((wish) => wishWords(wish.name, reached(scene, motion, wish, of))) : [];
}

/** @param {import("./types.js").Curve[]} curves @param {string} file */
function taken(curves, file) {
  const [{ region, place, ...curve }] = curves, regions = scene.terrain?.regions ?? [];
  const ground = regions.includes(region) ? { region: regions.indexOf(region), place: Math.min(place ?? 1, scene.terrain.places) - 1 } : {};
  store.commit((now) => ({ ...choose(now, curve), ...ground }));
  const more = curves.length > 1 ? `; ${curves.length - 1} more under Curve` : "";
  const lengths = curve.durations.length > 1 ? ` (of its durations ${curve.durations.join(", ")} s the middle one)` : "";
  const left = region && !regions.includes(region) ? `; its place on irregular ground is left out, since this policy knows flat ground alone` : "";
  say(`${file}: ${curve.name}${lengths}, ${alike(curve, scene.curves)}${more}${left}`);
}

for (const id of ["source", "follow", "apart", "standard"]) $(id).addEventListener("change", () => {
  stage.settings();
  sources.update();
  due.curves = true;
});
sources.addEventListener("change", () => { due.curves = true; });
addEventListener("resize", () => { due.strip = true; });
watchTheme($("theme"), () => {
  stage.theme();
  due.strip = true;
});
$("help").addEventListener("click", () => help(keys));
firstVisit();

/** Three lines, once. */
function firstVisit() {
  const key = "getup-edit-visited";
  $("hint").hidden = recalled("localStorage", key) !== null;
  $("hint-close").addEventListener("click", () => {
    $("hint").hidden = true;
    remember("localStorage", key, "1");
  });
}

// To the screen, in every animation frame.

function showFrame() {
  if (!scene || !store.project) return;
  drawCurves();
  // a picture that is begun now would be in the way of the one that a person waits for
  const pictured = !latency.expects && stage.draw(latency.waits);
  if (latency.waits && pictured) latency.drawn(stage.fence);
  if (!there && pictured && stage.view && results.active?.motion) {
    there = true;
    stage.whenFree(() => performance.mark("getup: page drawn"));
  }
  if (due.strip && stage.drawStrip()) due.strip = false;
}

function drawCurves() {
  const now = performance.now();
  if (!due.curves && !(due.frames && now > drawn + PACE_MS)) {
    if (player.moved) graph.drawTime();
    return;
  }
  graph.draw();
  due.curves = due.frames = false;
  drawn = now;
}

/** @param {string} text */
function veil(text) {
  $("veil").textContent = text;
  $("veil").hidden = !text;
}
