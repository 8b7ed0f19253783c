// The three curves as in a graph editor: what is selected, which part of time they show, and the tools'
// settings. The panels draw it; gestures and tools change it and the store.

import { duration, keysIn } from "./content.js";
import { KINDS } from "./features.js";
import { around, Scale, within } from "./graph_scale.js";
import { Panel } from "./panel.js";
import { lengths, valid } from "./selection.js";
import { FEATURES } from "./spline.js";

/** @import { Feature } from "./types.js" */
/** @import { Picked, Clip } from "./selection.js" */
/** @import { Range } from "./graph_scale.js" */

/**
 * @typedef {object} Model
 * @property {import("./store.js").Store} store
 * @property {import("./results.js").Results} results
 * @property {() => number} time
 * @property {() => number} span
 * @property {number} controlDt
 * @property {() => any} band
 * @property {() => import("./types.js").Recording | null} recording
 * @property {[number, number]} range in and out, s
 */

export class Graph {
  /** @param {HTMLElement} root @param {Model} model @param {(time: number) => void} seek */
  constructor(root, model, seek) {
    this.model = model;
    this.seek = seek;
    /** @type {Picked} */
    this.picked = {};
    /** @type {number[]} of the curves when those were selected */
    this.lengths = [];
    /** @type {Range | null} null: the whole motion */
    this.times = null;
    /** @type {Partial<Record<Feature, Range>>} where zoomed */
    this.values = {};
    this.snap = true;
    this.frames = false;
    /** @type {Clip | null} */
    this.clip = null;
    /** @type {{ name: string, values: Partial<Record<Feature, number>> } | null} that was copied, for any variant */
    this.pose = null;
    this.onSelect = () => {};
    this.panels = FEATURES.map((feature, index) => new Panel(root, this, feature, index));
    new ResizeObserver(() => this.draw()).observe(root);
  }

  get store() { return this.model.store; }

  /** @param {Picked} picked */
  select(picked) {
    this.picked = picked;
    this.lengths = lengths(this.store.now);
    this.draw();
    this.onSelect();
  }

  /** Those that are selected and still there. */
  get chosen() { return valid(this.store.now, this.picked, this.lengths); }

  /** @returns {Range} */
  get shownTimes() { return this.times ? within(this.times, this.model.span()) : [0, this.model.span()]; }

  /** Past the usual range only where keys, or the curve between them, need it. @param {Feature} feature @returns {Range} */
  shownValues(feature) {
    return this.values[feature] ?? around(keysIn(this.store.now, feature), KINDS[feature]);
  }

  /** @param {Feature} feature @param {number} width @param {number} height */
  scale(feature, width, height) { return new Scale(width, height, this.shownTimes, this.shownValues(feature)); }

  /** Time as a share of the duration, on whole frames where one wants that. @param {number} seconds @param {boolean} free */
  share(seconds, free = false) {
    const { controlDt } = this.model, whole = duration(this.store.now);
    return (this.snap && !free && controlDt ? Math.round(seconds / controlDt) * controlDt : seconds) / whole;
  }

  /** @param {Range | null} times */
  zoom(times) {
    this.times = times && within(times, this.model.span());
    if (this.times && this.times[1] - this.times[0] > this.model.span() - 1e-3) this.times = null;
    if (!times) this.values = {};
    this.draw();
  }

  draw() {
    if (!this.store.project || !this.model.controlDt) return;
    for (const panel of this.panels) panel.draw();
  }

  drawTime() { for (const panel of this.panels) panel.drawTime(); }
}
