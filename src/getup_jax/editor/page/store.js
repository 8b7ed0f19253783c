// What the user edits: up to four variants, each a curve and where it starts; undo and redo.
// It lives in the page and in the tab's session storage, so that no server can lose it.

import { FEATURES, POINTS } from "./spline.js";

export const MOST_VARIANTS = 4;
const KEY = "getup-edit";
const MOST_STEPS = 200;

export class Store extends EventTarget {
  constructor() {
    super();
    this.variants = [];
    this.active = 0;
    this.past = [];
    this.future = [];
    this.restore();
  }

  get current() { return this.variants[this.active]; }
  get curve() { return this.current.curve; }

  // Variants of the first visit.
  begin(curve) {
    if (!this.variants.length) this.variants = [variantOf(curve)];
    this.stamp = this.snapshot();
    this.changed("show");
  }

  // A change while a gesture goes on: shown and simulated, not yet a step to undo.
  live(change) {
    change(this.current);
    this.changed("live");
  }

  // The end of a gesture, or a change at once; at: when it ended.
  commit(change = () => {}, at = performance.now()) {
    change(this.current);
    const now = this.snapshot();
    if (now !== this.stamp) {
      this.past.push(this.stamp);
      if (this.past.length > MOST_STEPS) this.past.shift();
      this.future = [];
      this.stamp = now;
    }
    this.changed("commit", at);
  }

  undo() { this.step(this.past, this.future); }
  redo() { this.step(this.future, this.past); }

  step(from, to) {
    if (!from.length) return;
    to.push(this.stamp);
    this.stamp = from.pop();
    ({ variants: this.variants, active: this.active } = JSON.parse(this.stamp));
    this.changed("commit", performance.now());
  }

  // Replaces the curve of the active variant; reset goes back to it.
  choose(curve) {
    this.commit((variant) => {
      variant.curve = plain(curve);
      variant.reference = plain(curve);
    });
  }

  addVariant() {
    if (this.variants.length >= MOST_VARIANTS) return;
    this.variants.push(structuredClone(this.current));
    this.active = this.variants.length - 1;
    this.commit();
  }

  removeVariant(index) {
    if (this.variants.length < 2) return;
    this.variants.splice(index, 1);
    this.active = Math.min(this.active, this.variants.length - 1);
    this.commit();
    this.changed("show"); // the motion of the one that is now active may be there already
  }

  show(index) {
    this.active = index;
    this.stamp = this.snapshot();
    this.changed("show");
  }

  snapshot() { return JSON.stringify({ variants: this.variants, active: this.active }); }

  // at: when a gesture ended; null while it goes on, and where nothing was edited.
  changed(kind, at = null) {
    this.dispatchEvent(new CustomEvent("change", { detail: { kind, at } }));
    if (kind !== "live") sessionStorage.setItem(KEY, this.snapshot());
  }

  restore() {
    try {
      const kept = JSON.parse(sessionStorage.getItem(KEY));
      const whole = kept.variants.every((v) => FEATURES.every((f) => v.curve[f].length === POINTS));
      if (whole && kept.variants.length) ({ variants: this.variants, active: this.active } = kept);
    } catch { /* nothing was kept */ }
  }
}

function variantOf(curve) {
  return { curve: plain(curve), reference: plain(curve), region: 0, place: 0 };
}

// A curve of its own with one duration, the middle one of a file's.
function plain(curve) {
  const copy = structuredClone(curve);
  copy.durations = [copy.durations[Math.floor((copy.durations.length - 1) / 2)]];
  return copy;
}
