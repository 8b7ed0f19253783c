// What of time and value a panel shows, and where on the screen.

import { clamp } from "./features.js";
import { drawn } from "./keys.js";

export const LEFT = 40, RIGHT = 12, TOP = 22, BOTTOM = 20;
const LEAST_S = 0.2; // the shortest time that can be zoomed into
const STEPS = [0.1, 0.2, 0.5, 1, 2, 5];

/** @typedef {[number, number]} Range */

export class Scale {
  /** @param {number} width @param {number} height px @param {Range} times s @param {Range} values */
  constructor(width, height, times, values) {
    this.width = width;
    this.height = height;
    this.times = times;
    this.values = values;
  }

  get across() { return Math.max(this.width - LEFT - RIGHT, 1); }
  get down() { return Math.max(this.height - TOP - BOTTOM, 1); }
  /** @param {number} time s */
  x(time) { return LEFT + ((time - this.times[0]) / (this.times[1] - this.times[0])) * this.across; }
  /** @param {number} value */
  y(value) { return TOP + ((this.values[1] - value) / (this.values[1] - this.values[0])) * this.down; }
  /** @param {number} x px */
  time(x) { return this.times[0] + ((x - LEFT) / this.across) * (this.times[1] - this.times[0]); }
  /** @param {number} y px */
  value(y) { return this.values[1] - ((y - TOP) / this.down) * (this.values[1] - this.values[0]); }
}

/** The usual values and all that the curve through the keys takes, which between two of them may be beyond both, with room around. @param {import("./types.js").Key[]} keys @param {{ low: number, high: number }} usual @returns {Range} */
export function around(keys, { low, high }) {
  const values = [...keys.map((key) => key.value), ...drawn(keys)], pad = 0.06 * (high - low);
  return [Math.min(low, ...values) - pad, Math.max(high, ...values) + pad];
}

/** A range that is `factor` times as long, with `about` in its place. @param {Range} range @param {number} about @param {number} factor @returns {Range} */
export function zoomed([low, high], about, factor) { return [about + (low - about) * factor, about + (high - about) * factor]; }

/** The times that are shown once one of two fingers has moved: what lay between them stays there. @param {Scale} scale @param {number[]} other px @param {number[]} before px @param {number[]} now px @returns {Range} */
export function pinched(scale, other, before, now) {
  const apart = (/** @type {number[]} */ p) => Math.max(Math.hypot(p[0] - other[0], p[1] - other[1]), 1);
  const factor = apart(before) / apart(now), moved = (now[0] - before[0]) / 2;
  const [low, high] = zoomed(scale.times, scale.time((before[0] + other[0]) / 2), factor), by = (moved / scale.across) * (high - low);
  return [low - by, high - by];
}

/** A range of times inside of the whole motion. @param {Range} range @param {number} span s @returns {Range} */
export function within([low, high], span) {
  const length = clamp(high - low, Math.min(LEAST_S, span), span), start = clamp(low, 0, span - length);
  return [start, start + length];
}

/** Times (s) of the lines of a grid, about `most` of them, at whole frames where frames are counted. @param {Range} range @param {number} most */
export function timeTicks([low, high], most) {
  const step = STEPS.find((s) => (high - low) / s <= most) ?? 10;
  const ticks = [];
  for (let i = Math.ceil(low / step - 1e-6); i * step <= high + 1e-6; i++) ticks.push(Number((i * step).toFixed(3)));
  return ticks;
}

/** @param {number} time s @param {boolean} frames @param {number} fps */
export function timeLabel(time, frames, fps) { return frames ? String(Math.round(time * fps)) : String(time); }

/** To the nearest whole number of steps. @param {number} value @param {number} step */
export function snapped(value, step) { return Math.round(value / step) * step; }
