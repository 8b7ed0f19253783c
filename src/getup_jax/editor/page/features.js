// What the three curves are: their words, units and ranges.

/** @import { Feature } from "./types.js" */

/** @typedef {{ title: string, unit: string, low: number, high: number, step: number, digits: number, ticks: number[], hint: string }} Kind */

/** @type {Record<Feature, Kind>} */
export const KINDS = {
  height: { title: "Neck height", unit: "m", low: 0, high: 1.7, step: 0.01, digits: 3, ticks: [0, 0.5, 1, 1.5], hint: "above the ground" },
  side_angle: {
    title: "Lean to the side", unit: "°", low: 0, high: 180, step: 1, digits: 1, ticks: [0, 45, 90, 135, 180],
    hint: "90 level · 0 on its left · 180 on its right",
  },
  front_angle: {
    title: "Lean forward", unit: "°", low: 0, high: 180, step: 1, digits: 1, ticks: [0, 45, 90, 135, 180],
    hint: "0 on its back · 90 upright · 180 face down",
  },
};
export const LIES = ["prone", "supine", "side"];

/** A value as it is stored: within what a body can do, and as exact as a person would write it. @param {Feature} feature @param {number} value */
export function kept(feature, value) {
  const { low, high, digits } = KINDS[feature];
  return Number(Math.min(Math.max(value, low), high).toFixed(digits));
}

/** @param {number} value @param {number} low @param {number} high */
export function clamp(value, low, high) { return Math.min(Math.max(value, low), high); }
