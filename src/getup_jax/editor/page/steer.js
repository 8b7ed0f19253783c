// The page in which a character is steered: what comes from the server is shown a frame a control step,
// and the server is told which one, so that it simulates no faster. A hidden page stops the simulation.

import { $, option, write } from "./dom.js";
import { Link } from "./link.js";
import { say } from "./notice.js";
import { listen } from "./shortcuts.js";
import { Buffer } from "./steer_buffer.js";
import { aimOrder, directions, floorGoal, headingOrder, near, onFloor, onSphere, placeOrder } from "./steer_goals.js";
import { Hand } from "./steer_hand.js";
import { Markers, tip } from "./steer_markers.js";
import { Panel } from "./steer_panel.js";
import { watchTheme } from "./theme.js";
import { STANDARD, View } from "./view.js";

const FOLLOW_S = 0.25; // the camera is so far behind the body
const PENDING = [0.95, 0.75, 0.1, 0.6]; // of what was asked for and is not heard yet
const link = new Link(), markers = new Markers();
const panel = new Panel({ policy, order });
/** @type {any} */
let scene = null;
/** @type {View | null} */
let view = null;
/** @type {Buffer} */
let buffer;
/** @type {import("./steer_buffer.js").Frame | null} */
let frame = null;
let poses = new Float32Array(7);
let playing = true, last = performance.now();
/** @typedef {import("./steer_markers.js").Marker} Marker */
/** @type {Map<string, object>} orders that wait for the next picture, the newest of each goal */
const held = new Map();
/** @type {Map<string, { order: string, change: (marker: Marker) => Marker }>} what frames do not show yet */
const asked = new Map();

// From the server.

link.addEventListener("status", (/** @type {any} */ { detail }) => { veil(detail.text); connected(true); });
link.addEventListener("ready", (/** @type {any} */ { detail }) => ready(detail.scene));
link.addEventListener("frame", (/** @type {any} */ { detail }) => buffer?.add(detail));
link.addEventListener("policies", (/** @type {any} */ { detail }) => { panel.fill(detail.policies); say("Compiled."); });
link.addEventListener("loading", (/** @type {any} */ { detail }) => say(`${detail.name}: ${detail.text}`, false, null, true));
link.addEventListener("error", (/** @type {any} */ { detail }) => say(detail.text, true));
link.addEventListener("lost", (/** @type {any} */ { detail }) => {
  connected(false);
  write($("banner"), `The connection is lost${detail.reason ? ` (${detail.reason})` : ""}. Connecting again …`);
});

/** @param {boolean} there */
function connected(there) {
  $("banner").hidden = there;
  $("dot").className = there ? "dot ok" : "dot";
  $("dot").setAttribute("aria-label", there ? "connected" : "not connected");
}

/** @param {any} description */
function ready(description) {
  connected(true);
  veil("");
  if (scene && JSON.stringify([scene.links, scene.shapes]) !== JSON.stringify([description.links, description.shapes])) return location.reload();
  scene = description;
  buffer = new Buffer(scene.control_dt);
  asked.clear();
  panel.fill(scene.policies);
  if (!view) begin();
  link.send({ type: "begin" });
}

function begin() {
  try { view = new View($("view"), scene); } catch { return veil("This browser has no WebGL, which the view needs."); }
  view.arrange([0], 0);
  view.scene.add(markers.group);
  new Hand(view, { knobs, click, drag });
  watchTheme($("theme"), () => view?.theme());
  requestAnimationFrame(tick);
}

// Time.

/** @param {number} now ms */
function tick(now) {
  const seconds = Math.min((now - last) / 1000, 0.2);
  last = now;
  const next = playing ? buffer.advance(seconds * Number($("speed").value)) : null;
  if (next) show(next);
  for (const [goal, order] of held) link.send({ type: "order", goal, order });
  held.clear();
  if (view && frame) {
    if ($("follow").checked) view.centre(poses, 1 - Math.exp(-seconds / FOLLOW_S));
    view.draw();
  }
  requestAnimationFrame(tick);
}

/** @param {import("./steer_buffer.js").Frame} next */
function show(next) {
  frame = next;
  poses = new Float32Array(next.payload);
  link.send({ type: "shown", frame: next.number });
  panel.show(next, body());
  write($("clock"), `${next.time.toFixed(1)} s`);
  write($("pace"), buffer.pace < 0.9 ? `${(buffer.pace * Number($("speed").value)).toFixed(1)} × real time` : "");
  write($("how"), how());
  document.body.dataset.frame = String(next.number);
  if (!view) return;
  const { floor, bodies } = view;
  view.put(/** @type {any} */ (bodies.get(0)), String(next.number), () => poses);
  for (const part of floor ?? []) part.position.set(Math.round(poses[0]), Math.round(poses[1]), 0); // it has no end
  markers.show(shown(next));
}

/** All that is asked for; what the server has not heard yet is shown as it will be. @param {any} next @returns {Marker[]} */
function shown(next) {
  const found = [...next.balls];
  for (const [name, goal] of Object.entries(next.goals)) {
    if (asked.get(name)?.order === JSON.stringify(goal.told?.order)) asked.delete(name);
    const flat = floorGoal(panel.goals)?.[0] === name, change = asked.get(name)?.change, radius = panel.goals[name]?.radius_m;
    for (const marker of goal.markers) {
      const onIt = flat && !marker.reach ? { ...marker, flat, radius: radius ?? marker.radius, rgba: [...marker.rgba.slice(0, 3), 0.5] } : marker;
      found.push(change ? change(onIt) : onIt);
    }
  }
  return found;
}

function body() { return [poses[0], poses[1]]; }

// What is told.

/** @param {string} goal @param {object} order @param {(marker: Marker) => Marker} change of its markers */
function order(goal, order, change = (marker) => marker) {
  held.set(goal, order);
  asked.set(goal, { order: JSON.stringify(order), change });
  if (!view || !frame) return;
  markers.show(shown(frame));
  view.dirty = true;
}

/** @param {string} name */
function policy(name) {
  asked.clear();
  link.send({ type: "policy", name });
}

function knobs() {
  if (!frame) return [];
  const { goals } = frame;
  return directions(panel.goals).flatMap((goal) => (goals[goal]?.markers ?? []).filter((/** @type {Marker} */ m) => m.reach).map((/** @type {Marker} */ m) => ({ goal, tip: tip(m) })));
}

/** @param {[number, number] | null} place */
function click(place) {
  if (!place) return say("That is the sky: click on the floor.");
  const goals = panel.goals, floor = floorGoal(goals), to = near(body(), place);
  if (floor) {
    const [goal, key] = floor;
    order(goal, key === "place" ? placeOrder(body(), to, goals[goal]) : { [key]: to }, (marker) => (marker.reach ? marker : { ...marker, position: [...to, 0], rgba: PENDING }));
  } else if ("target_heading" in goals) turn(to);
  else say(`${panel.acting} has no goal on the floor: there is nothing to tell it there.`);
}

/** Walk that way. @param {number[]} place */
function turn(place) {
  const heading = headingOrder(body(), place, panel.goals.target_heading), yaw = (heading.yaw_deg * Math.PI) / 180;
  order("target_heading", heading, (marker) => ({ ...marker, reach: [heading.speed * Math.cos(yaw), heading.speed * Math.sin(yaw), 0] }));
}

/** @param {string} goal @param {import("./steer_goals.js").Point} origin @param {import("./steer_goals.js").Point} along */
function drag(goal, origin, along) {
  const arrow = frame?.goals[goal]?.markers.find((/** @type {Marker} */ m) => m.reach);
  if (!arrow) return;
  const place = onFloor(origin, along);
  if (goal === "target_heading") return place && turn(place);
  const length = Math.hypot(...arrow.reach), reach = onSphere(origin, along, arrow.position, length), share = length / Math.hypot(...reach);
  order(goal, aimOrder(reach), (marker) => (marker.reach ? { ...marker, reach: reach.map((r) => share * r) } : marker));
}

// The bar below, and keys.

function toggle(now = !playing) {
  playing = now;
  write($("play"), playing ? "❚❚" : "▶");
}

function push() {
  const away = view ? (view.orbit.azimuth * 180) / Math.PI + 180 : 0;
  link.send({ type: "push", yaw_deg: ((away % 360) + 360) % 360 });
}

function restart() {
  toggle(true);
  asked.clear();
  link.send({ type: "restart" });
}

function how() {
  const goals = panel.goals, parts = [];
  if (floorGoal(goals)) parts.push("click the floor: go there");
  else if ("target_heading" in goals) parts.push("click the floor: go that way");
  if (directions(goals).length) parts.push("drag an arrow’s tip");
  return [...parts, "drag: orbit", "Space, R, P, 1–9"].join(" · ");
}

/** @param {string} text */
function veil(text) {
  write($("veil"), text);
  $("veil").hidden = !text;
}

$("play").addEventListener("click", () => toggle());
$("restart").addEventListener("click", restart);
$("push").addEventListener("click", push);
$("standard").replaceChildren(option("", "View…"), ...Object.entries(STANDARD).map(([value, text]) => option(value, text)));
$("standard").addEventListener("change", () => {
  const [w, z] = [poses[3], poses[6]];
  view?.look($("standard").value, 2 * Math.atan2(z, w));
  $("standard").value = "";
});
listen([
  { keys: "Space", words: "play, pause", press: [" "], act: () => toggle() },
  { keys: "R", words: "begin anew", press: ["r"], act: restart },
  { keys: "P", words: "push it away from you", press: ["p"], act: push },
  ...Array.from({ length: 9 }, (_, i) => ({ keys: "", words: "", press: [String(i + 1)], act: () => { if (panel.policies[i]) policy(panel.policies[i].name); } })),
]);
