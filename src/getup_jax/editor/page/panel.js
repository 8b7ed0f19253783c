// One curve: its keys and lines, what the body does, ghosts, the guide, and where physics cannot follow.

import { duration, keysIn, misfit } from "./content.js";
import { el } from "./dom.js";
import { KINDS } from "./features.js";
import { BOTTOM, LEFT, RIGHT, timeLabel, timeTicks, TOP } from "./graph_scale.js";
import { Gestures } from "./gestures.js";
import { drawn, SAMPLES } from "./keys.js";
import { errorParts, recordingLine } from "./panel_motion.js";
import { sample } from "./spline.js";
import { fill, make, polyline, set, text } from "./svg.js";

/** @import { Feature } from "./types.js" */

const ROOM_PX = 10; // for a point on the edge
const LEGEND_PX = 420; // narrower, words would lie on each other
const MISFIT = { height: 0.015, side_angle: 2, front_angle: 2 }; // shown from here on: m, degrees

export class Panel {
  /** @param {HTMLElement} root @param {import("./graph.js").Graph} graph @param {Feature} feature @param {number} index */
  constructor(root, graph, feature, index) {
    this.graph = graph;
    this.feature = feature;
    this.index = index;
    this.kind = KINDS[feature];
    this.width = this.height = 0;
    this.box = document.createElement("div");
    this.box.className = "panel";
    this.svg = make("svg", { role: "group", "aria-label": this.kind.title });
    this.back = make("g");
    this.inside = make("rect");
    const clip = make("clipPath", { id: `inside-${feature}` }), clipped = { "clip-path": `url(#inside-${feature})` };
    clip.append(this.inside);
    this.lines = make("g", clipped);
    this.dots = make("g", clipped);
    this.over = make("g");
    this.now = el("div", { class: "now" }); // no part of the drawing, since it moves in every frame
    this.svg.append(clip, this.back, this.lines, this.over, this.dots);
    this.box.append(this.svg, this.now);
    root.append(this.box);
    /** @type {SVGElement[]} */
    this.points = [];
    this.shown = "";
    this.gestures = new Gestures(this);
  }

  get keys() { return keysIn(this.graph.store.now, this.feature); }
  get scale() { return this.held ?? this.graph.scale(this.feature, this.width, this.height); }

  /** The scale stays as it is while a hand is on it. @param {boolean} on */
  hold(on) { this.held = on ? this.graph.scale(this.feature, this.width, this.height) : undefined; }

  draw() {
    const { clientWidth: width, clientHeight: height } = this.box;
    if (width !== this.width || height !== this.height) {
      Object.assign(this, { width, height });
      set(this.svg, { viewBox: `0 0 ${width} ${height}` });
      // what is zoomed reaches over neither words nor numbers
      const across = Math.max(width - LEFT - RIGHT + 2 * ROOM_PX, 0), down = Math.max(height - TOP - BOTTOM + 4, 0);
      set(this.inside, { x: LEFT - ROOM_PX, y: TOP - 2, width: across, height: down });
    }
    if (!width) return;
    this.drawBack();
    fill(this.lines, [...this.bandParts(), ...this.lineParts()]);
    this.drawPoints();
    this.drawTime();
  }

  /** Grid and words, made anew only where they change: most edits leave them as they are. */
  drawBack() {
    const { scale, graph } = this, { store, model } = graph;
    const shown = [this.width, this.height, duration(store.now), graph.frames, model.range, scale.times, scale.values].join();
    if (shown === this.shown) return;
    this.shown = shown;
    this.back.replaceChildren(...this.backParts());
  }

  backParts() {
    const { scale, kind, graph } = this, bottom = this.height - BOTTOM, right = this.width - RIGHT, parts = [];
    const inside = (/** @type {number} */ y) => y >= TOP - 1 && y <= bottom + 1;
    for (const tick of kind.ticks.filter((value) => inside(scale.y(value)))) {
      parts.push(make("line", { class: "grid", x1: LEFT, x2: right, y1: scale.y(tick), y2: scale.y(tick) }));
      parts.push(text(LEFT - 9, scale.y(tick) + 3.5, String(tick), { "text-anchor": "end" }));
    }
    for (const t of timeTicks(scale.times, scale.across / 45)) {
      parts.push(make("line", { class: "grid", x1: scale.x(t), x2: scale.x(t), y1: TOP, y2: bottom }));
      parts.push(text(scale.x(t), this.height - 6, timeLabel(t, graph.frames, 1 / graph.model.controlDt), { "text-anchor": "middle" }));
    }
    for (const edge of graph.model.range) {
      const x = scale.x(edge);
      if (x >= LEFT && x <= right) parts.push(make("line", { class: "edge", x1: x, x2: x, y1: TOP, y2: bottom }));
    }
    const end = scale.x(duration(graph.store.now));
    if (end >= LEFT && end <= right) {
      parts.push(make("line", { class: "end", x1: end, x2: end, y1: TOP, y2: bottom }), text(end + 4, TOP + 9, "T"));
    }
    return [...parts, ...this.words()];
  }

  words() {
    const title = text(LEFT, 15, this.kind.title, { class: "title" }), unit = make("tspan", { class: "unit" });
    unit.textContent = ` ${this.kind.unit} · ${this.kind.hint}`;
    title.append(unit);
    const legend = this.index || this.width < LEGEND_PX ? "" : "blue asked for · orange done";
    return [title, text(this.width - RIGHT, 15, legend, { "text-anchor": "end" })];
  }

  bandParts() {
    const band = this.graph.model.band();
    if (!band) return [];
    const { scale } = this, seconds = duration(this.graph.store.now), last = band.mean.length - 1;
    const line = (/** @type {number} */ sign) => band.mean.map((/** @type {number[]} */ row, /** @type {number} */ i) => (
      `${scale.x((i / last) * seconds)},${scale.y(row[this.index] + sign * band.deviation[i][this.index])}`));
    return [
      { name: "polygon", attributes: { class: "band", points: [...line(1), ...line(-1).reverse()].join(" ") } },
      polyline("mean", line(0)),
    ];
  }

  /** @returns {import("./svg.js").Part[]} */
  lineParts() {
    const { graph, scale } = this, { store, model } = graph, { results } = model, parts = [];
    for (const { slot } of store.variants) {
      if (slot !== store.active) parts.push(...this.achieved(results.shown.get(slot)?.motion, `ghost of${slot}`, `ghost of${slot}`));
    }
    const recording = model.recording();
    if (recording) parts.push(recordingLine(recording, this.index, scale, duration(store.now)));
    const keys = this.keys, curve = drawn(keys), seconds = duration(store.now);
    const line = curve.map((value, i) => `${scale.x((i / (SAMPLES - 1)) * seconds).toFixed(1)},${scale.y(value).toFixed(2)}`);
    const motion = results.active?.motion;
    if (motion) parts.push(...errorParts(motion, this.index, this.feature, { scale, height: this.height, dt: model.controlDt }, curve, seconds));
    parts.push(polyline("target", [...line, `${scale.x(model.span())},${scale.y(curve[SAMPLES - 1])}`]));
    if (misfit(store.now, this.feature) > MISFIT[this.feature]) parts.push(this.fitted(seconds));
    return [...parts, ...this.achieved(motion, "achieved", "achieved after")];
  }

  /** What the policy sees, where nine control points cannot follow what was drawn. @param {number} seconds */
  fitted(seconds) {
    const { scale } = this, seen = sample(this.graph.store.now.curve[this.feature]);
    const line = seen.map((v, i) => `${scale.x((i / (SAMPLES - 1)) * seconds)},${scale.y(v)}`);
    return polyline("fitted", line, "The policy sees nine control points: this is the nearest that they come to your curve.");
  }

  /** @param {import("./motion.js").Motion | null | undefined} motion @param {string} name @param {string} after */
  achieved(motion, name, after) {
    if (!motion) return [];
    const { scale } = this, dt = this.graph.model.controlDt, values = motion.features[this.index];
    const line = (/** @type {number} */ from, /** @type {number} */ to) => {
      const points = [];
      for (let i = from; i < to; i++) points.push(`${scale.x((i + 1) * dt).toFixed(1)},${scale.y(values[i]).toFixed(1)}`);
      return points;
    };
    const end = Math.min(motion.ended, motion.count);
    const parts = [polyline(name, line(0, end))];
    if (end < motion.count) parts.push(polyline(after, line(Math.max(end - 1, 0), motion.count)));
    return parts;
  }

  drawPoints() {
    const { scale, kind, keys } = this, seconds = duration(this.graph.store.now), chosen = this.graph.chosen[this.feature] ?? [];
    while (this.points.length < keys.length) this.points.push(this.gestures.makePoint(this.points.length));
    this.points.length > keys.length && this.points.splice(keys.length).forEach((dot) => dot.remove());
    keys.forEach((key, i) => {
      const dot = this.points[i];
      if (dot.parentNode !== this.dots) this.dots.append(dot);
      const at = key.time * seconds;
      set(dot, {
        cx: scale.x(at), cy: scale.y(key.value), "data-kind": key.kind, "aria-selected": chosen.includes(i),
        "aria-label": `${kind.title}, point ${i + 1} of ${keys.length}, ${at.toFixed(2)} s, ${key.kind}`, "aria-valuetext": `${key.value} ${kind.unit}`,
        "aria-valuenow": key.value, "aria-valuemin": kind.low, "aria-valuemax": kind.high,
      });
      dot.classList.toggle("picked", chosen.includes(i));
    });
    this.gestures.drawFrame(chosen);
  }

  drawTime() {
    if (!this.width) return;
    const { scale } = this, x = scale.x(Math.min(this.graph.model.time(), this.graph.model.span()));
    this.now.style.transform = `translateX(${x.toFixed(1)}px)`;
    this.now.hidden = x < LEFT - 1 || x > this.width - RIGHT + 1;
  }
}
