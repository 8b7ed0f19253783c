// The row above the curves: what is done to the keys that are selected, to a part of time, and a pose
// that is wished there.

import { duration, keysIn } from "./content.js";
import { $, el, group, option, write } from "./dom.js";
import * as edits from "./edits.js";
import { clamp, KINDS } from "./features.js";
import { featuresAt } from "./motion_recording.js";
import { say } from "./notice.js";
import { POSES } from "./poses.js";
import { LETTERS } from "./project.js";
import * as selection from "./selection.js";
import { FEATURES } from "./spline.js";
import { set } from "./svg.js";

/** @import { Feature, Kind } from "./types.js" */

/** @type {[Kind, string, string][]} */
const PASSING = [
  ["auto", "Auto", "Bends evenly through the point"], ["flat", "Flat", "Level at the point: neither rises nor falls"], ["linear", "Linear", "Straight to the points beside it"],
];

const NOTHING = "paste pose: none is copied yet";

export class Tools {
  /** @param {HTMLElement} root @param {import("./graph.js").Graph} graph @param {import("./player.js").Player} player */
  constructor(root, graph, player) {
    this.graph = graph;
    this.player = player;
    const button = (/** @type {string} */ id, /** @type {string} */ words, /** @type {string} */ title, /** @type {() => void} */ act) => el("button", { id, title, onclick: act }, words);
    const number = (/** @type {string} */ id, /** @type {string} */ label, /** @type {(value: number) => void} */ act) => {
      const change = (/** @type {any} */ { target }) => (target.value === "" ? this.show() : act(Number(target.value)));
      return el("input", { id, type: "number", step: "any", "aria-label": label, title: label, onchange: change });
    };
    root.append(
      el("span", { class: "pair" }, ...PASSING.map(([kind, words, title]) => button(`pass-${kind}`, words, title, () => this.passing(kind)))),
      el("label", { title: "Of the selected points" }, number("key-time", "Time of the points", (t) => this.time(t)), el("span", { id: "time-unit" }, "s")),
      el("label", { title: "Of the selected points" }, number("key-value", "Value of the points", (v) => this.value(v)), el("span", { id: "value-unit" }, "m")),
      button("key-delete", "Delete", "The selected points (Del)", () => this.remove()),
      el("span", { class: "pair" }, button("key-copy", "Copy", "Ctrl+C", () => this.copy()), button("key-paste", "Paste", "At the time at hand, in this or another variant; from one angle's curve also into that of the selected point (Ctrl+V)", () => this.paste())),
      el("span", { class: "pair" }, button("hold", "Hold", "A pause at the time at hand; everything after it comes later (H)", () => this.hold()), number("hold-seconds", "Seconds of a pause", () => {})),
      el("span", { class: "pair" }, button("stretch", "Stretch ×", "The part from in to out, or all of it, takes so many times as long", () => this.stretch()), number("stretch-factor", "Times as long", () => {})),
      el("select", { id: "pose", "aria-label": "Pose", title: "A pose from in to out, or at the time at hand: its height and angles become the curves there", onchange: () => this.pose() }),
      el("label", { title: "To whole frames and round values; Ctrl for the other way" }, el("input", { id: "snap", type: "checkbox", ".checked": true, onchange: (/** @type {any} */ e) => { graph.snap = e.target.checked; } }), "Snap"),
      el("label", { title: "Frame numbers in place of seconds" }, el("input", { id: "frames", type: "checkbox", onchange: (/** @type {any} */ e) => this.frames(e.target.checked) }), "Frames"),
      button("fit", "Fit", "Show the whole motion (F)", () => graph.zoom(null)),
    );
    $("hold-seconds").value = 1;
    $("stretch-factor").value = 1.5;
    graph.onSelect = () => this.show();
  }

  get store() { return this.graph.store; }
  get picked() { return this.graph.chosen; }
  /** The time at hand as a share of the duration. */
  get at() { return clamp(this.player.time / duration(this.store.now), 0, 1); }

  /** In and out as shares of the duration. */
  get part() {
    const seconds = duration(this.store.now);
    return [this.player.from, this.player.to].map((t) => clamp(t / seconds, 0, 1));
  }

  /** @param {Kind} kind */
  passing(kind) { if (this.some()) this.store.commit((now) => selection.passing(now, this.picked, kind)); }

  some() {
    if (selection.count(this.picked)) return true;
    say("Select points first: click one, or draw a box around several.");
    return false;
  }

  /** @param {number} typed */
  time(typed) {
    const seconds = this.graph.frames ? typed * this.graph.model.controlDt : typed;
    this.store.commit((now) => selection.place(now, this.picked, { time: seconds / duration(now) }));
  }

  /** @param {number} value */
  value(value) { this.store.commit((now) => selection.place(now, this.picked, { value })); }

  remove() {
    if (!this.some()) return;
    this.store.commit((now) => selection.remove(now, this.picked));
    this.graph.select({});
  }

  copy() {
    if (!this.some()) return;
    this.graph.clip = selection.copy(this.store.now, this.picked);
    const count = selection.count(this.picked);
    say(`${count} ${count === 1 ? "point" : "points"} copied; paste begins at the time at hand.`);
  }

  paste() {
    if (!this.graph.clip) return say("Nothing is copied yet.");
    const { at } = this, clip = selection.onto(this.graph.clip, this.picked);
    this.store.commit((now) => selection.paste(now, clip, at));
    this.graph.select(selection.pasted(this.store.now, clip, at));
  }

  all() {
    this.graph.select(Object.fromEntries(FEATURES.map((f) => [f, keysIn(this.store.now, f).map((_, i) => i)])));
  }

  hold() {
    const seconds = clamp(Number($("hold-seconds").value) || 1, 0.1, 10), before = duration(this.store.now), { at } = this;
    $("hold-seconds").value = seconds;
    this.store.commit((now) => edits.hold(now, at, seconds));
    this.graph.select({}); // other keys are at those numbers now
    const added = duration(this.store.now) - before;
    say(added > 0.05 ? `A pause of ${added.toFixed(1)} s at ${(at * before).toFixed(2)} s` : "The motion is as long as it may be.");
  }

  stretch() {
    const factor = clamp(Number($("stretch-factor").value) || 1, 0.1, 10), [from, to] = this.part;
    $("stretch-factor").value = factor;
    if (to - from < 0.01) return say("From in to out there is nothing of the curves.");
    this.store.commit((now) => edits.stretch(now, from, to, factor));
    this.graph.select({});
    this.player.setRange(null);
  }

  /** Poses that curves can wish for: of a small library, and the one of a start. @param {any} scene */
  fillPoses(scene) {
    const starts = scene.starts.map((/** @type {any} */ s, /** @type {number} */ i) => option(`s${i}`, s.name));
    const poses = POSES.map(({ name }, i) => option(`p${i}`, name));
    $("pose").replaceChildren(option("", "Pose…"), group("poses", poses), group("this motion", [option("now", "as the body is at the time at hand"), option("source", "as its source is at the time at hand")]),
      group("for another variant or time", [option("copy-now", "copy pose: the body's at the time at hand"), option("copy-source", "copy pose: its source's at the time at hand"), option("copied", NOTHING, true)]), group("lying as", starts));
    this.scene = scene;
  }

  pose() {
    const select = $("pose"), value = select.value;
    select.value = "";
    if (value.startsWith("copy-")) return this.copyPose(value.slice(5));
    const values = this.valuesOf(value);
    if (!values) return;
    const [from, to] = this.player.range ? this.part : [this.at, this.at];
    const pose = value[0] === "p" ? POSES[Number(value.slice(1))] : undefined;
    this.store.commit((now) => edits.wish(now, from, to, values, pose && { name: pose.name, contacts: pose.contacts }));
    this.graph.select({});
    say("Height and angles are wished there. What touches the ground is the policy's choice: the report says what was reached.");
  }

  /** The pose at the time at hand, to be pasted at another one, here or in another variant. @param {string} of "now": the body's; "source" */
  copyPose(of) {
    const values = this.valuesOf(of);
    if (!values) return;
    const name = `${LETTERS[this.store.active]} at ${this.player.time.toFixed(2)} s`;
    this.graph.pose = { name, values };
    const paste = $("pose").querySelector("option[value=copied]");
    Object.assign(paste, { disabled: false, textContent: `paste pose: ${name}` });
    say(`The pose of ${name} is copied; paste it with the same list.`);
  }

  /** @param {string} value of an option @returns {Partial<Record<Feature, number>> | null} */
  valuesOf(value) {
    if (value[0] === "p") return POSES[Number(value.slice(1))].values;
    const motion = this.graph.model.results.active?.motion;
    if (value === "now") {
      if (!motion) return null;
      const frame = this.player.frame(motion, this.graph.model.controlDt);
      return Object.fromEntries(FEATURES.map((f, i) => [f, motion.features[i][frame]]));
    }
    if (value === "copied") return this.graph.pose?.values ?? null;
    if (value === "source") return this.sourceValues();
    if (value[0] !== "s") return null;
    const { first } = this.scene.starts[Number(value.slice(1))];
    return Object.fromEntries(FEATURES.map((f, i) => [f, first[i]]));
  }

  /** Of the motion that the curve was made from, at the time at hand. @returns {Partial<Record<Feature, number>> | null} */
  sourceValues() {
    const recording = this.graph.model.recording();
    if (!recording) say("Show the Source first: the motion that this curve was made from.");
    const found = recording && featuresAt(recording, this.at);
    return found && Object.fromEntries(FEATURES.map((f, i) => [f, found[i]]));
  }

  /** @param {boolean} on */
  frames(on) {
    this.graph.frames = on;
    this.player.shown = "";
    this.graph.draw();
    this.show();
  }

  /** Shows the selection: its time and value where all have the same. */
  show() {
    const { graph, picked } = this, now = this.store.now, seconds = duration(now);
    const keys = FEATURES.flatMap((f) => (picked[f] ?? []).map((i) => ({ ...keysIn(now, f)[i], feature: f })));
    const one = (/** @type {(key: typeof keys[0]) => string | number} */ of) => {
      const found = new Set(keys.map(of));
      return found.size === 1 ? [...found][0] : "";
    };
    const kindOf = (/** @type {typeof keys[0]} */ key) => (key.feature === "height" ? "m" : "°"), units = new Set(keys.map(kindOf));
    const unit = units.size === 1 ? [...units][0] : ""; // metres and degrees have no value in common
    const time = one(({ time: t }) => (graph.frames ? Math.round((t * seconds) / graph.model.controlDt) : Number((t * seconds).toFixed(3))));
    this.put("key-time", time, keys.length);
    this.put("key-value", one((key) => Number(key.value.toFixed(3))), unit ? keys.length : 0);
    write($("time-unit"), graph.frames ? "frame" : "s");
    write($("value-unit"), unit);
    const kind = one((key) => key.kind), angles = keys.length && keys.every((k) => k.feature !== "height");
    for (const [passing] of PASSING) set($(`pass-${passing}`), { "aria-pressed": kind === passing });
    set($("key-value"), { step: angles ? KINDS.side_angle.step : KINDS.height.step });
  }

  /** @param {string} id @param {number | string} value @param {number} count */
  put(id, value, count) {
    const input = $(id);
    input.disabled = !count;
    input.placeholder = count > 1 && value === "" ? "mixed" : "";
    if (input.value !== String(value)) input.value = value;
  }
}
