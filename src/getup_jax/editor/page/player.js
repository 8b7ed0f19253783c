// Time: play, pause, scrub, speed, in and out, and which frame is shown.

import { clamp } from "./features.js";

const REST_S = 0.7; // the last pose stays this long before a loop begins again

/** @typedef {{ span: () => number, controlDt: number, frames: () => boolean }} Model */

export class Player {
  /** @param {Record<string, any>} elements @param {Model} model @param {() => void} onFrame @param {() => void} onRange */
  constructor(elements, model, onFrame, onRange) {
    this.elements = elements;
    this.model = model;
    this.onFrame = onFrame;
    this.onRange = onRange;
    /** @type {[number, number] | null} in and out; null: the whole motion */
    this.range = null;
    this.shown = "";
    this.time = 0;
    this.playing = true;
    this.rest = 0;
    this.moved = true;
    this.last = performance.now();
    this.listen();
    const tick = (/** @type {number} */ now) => {
      this.advance((now - this.last) / 1000);
      this.last = now;
      requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  listen() {
    const { play, scrub, first, back, on } = this.elements;
    play.addEventListener("click", () => this.toggle());
    first.addEventListener("click", () => this.seek(this.from));
    back.addEventListener("click", () => this.step(-1));
    on.addEventListener("click", () => this.step(1));
    scrub.addEventListener("input", () => this.seek(Number(scrub.value) * this.model.span()));
    this.elements.in.addEventListener("click", () => this.mark(0));
    this.elements.out.addEventListener("click", () => this.mark(1));
    this.elements.range.addEventListener("dblclick", () => this.setRange(null));
  }

  /** In (s). */
  get from() { return this.range ? Math.min(this.range[0], this.model.span()) : 0; }
  /** Out (s). */
  get to() { return this.range ? Math.min(this.range[1], this.model.span()) : this.model.span(); }

  toggle(playing = !this.playing) {
    if (playing && this.time >= this.to - 1e-3) this.time = this.from;
    this.playing = playing;
    this.shown = ""; // the clock says where exactly it stopped
    this.elements.play.textContent = playing ? "❚❚" : "▶";
  }

  /** @param {number} time s */
  seek(time) {
    this.toggle(false);
    this.time = clamp(time, 0, this.model.span());
  }

  /** @param {number} frames */
  step(frames) { this.seek(this.time + frames * this.model.controlDt); }

  /** In (0) or out (1) is the time at hand; once more at the same time takes it away. @param {0 | 1} end */
  mark(end) {
    /** @type {[number, number]} */
    const range = [this.from, this.to];
    const whole = end ? this.model.span() : 0;
    range[end] = Math.abs(range[end] - this.time) < 1e-3 ? whole : this.time;
    if (range[0] > range[1] - 2 * this.model.controlDt) range[1 - end] = end ? 0 : this.model.span();
    this.setRange(range[0] <= 0 && range[1] >= this.model.span() ? null : range);
  }

  /** @param {[number, number] | null} range */
  setRange(range) {
    this.range = range;
    this.shown = "";
    this.onRange();
  }

  restart() {
    if (this.playing) this.time = this.from;
    this.rest = 0;
  }

  /** @param {number} seconds */
  advance(seconds) {
    if (this.playing) {
      this.time += Math.min(seconds, 0.2) * Number(this.elements.speed.value);
      if (this.time >= this.to) this.turn(seconds);
    }
    this.time = Math.min(this.time, this.model.span());
    this.show();
    this.onFrame();
  }

  /** At the end: wait a moment, then begin again or stop. @param {number} seconds */
  turn(seconds) {
    this.time = this.to;
    this.rest += seconds;
    if (this.rest <= REST_S) return;
    this.rest = 0;
    if (this.elements.loop.checked) this.time = this.from;
    else this.toggle(false);
  }

  /** Words and lines change with the motion's frames, not with those of the screen. */
  show() {
    const { scrub, clock, range } = this.elements, step = this.model.controlDt || 0.01, span = Math.max(this.model.span(), 1e-6);
    const shown = `${Math.round(this.time / step)} of ${span} ${this.model.frames()}`;
    this.moved = shown !== this.shown;
    if (!this.moved) return;
    this.shown = shown;
    scrub.value = this.time / span;
    const frame = Math.round(this.time / step);
    clock.textContent = this.model.frames() ? `${frame} / ${Math.round(span / step)}` : `${this.time.toFixed(2)} s · ${frame}`;
    range.style.left = `${(100 * this.from) / span}%`;
    range.style.right = `${100 - (100 * this.to) / span}%`;
  }

  /** The frame of a motion at this time, as far as it has arrived. @param {{ count: number }} motion @param {number} controlDt */
  frame(motion, controlDt) { return clamp(Math.round(this.time / controlDt) - 1, 0, motion.count - 1); }
}
