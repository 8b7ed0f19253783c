// Lines of a panel that come from motions: the source of a clip, and the errors under the curve.

import { BOTTOM } from "./graph_scale.js";
import { SAMPLES } from "./keys.js";
import { polyline } from "./svg.js";

/** @import { Feature, Recording } from "./types.js" */
/** @import { Scale } from "./graph_scale.js" */

export const LOST = { height: 0.15, side_angle: 20, front_angle: 20 }; // m, degrees: physics does not follow here
const TALL_PX = 22; // of an error that counts as lost

/** @param {Recording} recording @param {number} index of the feature @param {Scale} scale @param {number} seconds that the curve takes */
export function recordingLine(recording, index, scale, seconds) {
  const { frames, total, links } = recording, width = links * 7 + 3, points = [];
  for (let i = 0; i < total; i++) {
    points.push(`${scale.x((i / Math.max(total - 1, 1)) * seconds).toFixed(1)},${scale.y(frames[i * width + links * 7 + index]).toFixed(1)}`);
  }
  return polyline("recorded", points);
}

/** The error of every frame that has come. @param {import("./motion.js").Motion} motion @param {number} index @param {number[]} curve 129 values @param {number} seconds @param {number} dt */
export function errors(motion, index, curve, seconds, dt) {
  const found = [];
  for (let i = 0; i < motion.count; i++) {
    const at = Math.min(((i + 1) * dt) / seconds, 1) * (SAMPLES - 1), low = Math.min(Math.floor(at), SAMPLES - 2);
    found.push(motion.features[index][i] - (curve[low] + (at - low) * (curve[low + 1] - curve[low])));
  }
  return found;
}

/** Runs of frames in which physics does not follow, [first, last]. @param {number[]} found @param {number} most */
export function lostRuns(found, most) {
  /** @type {[number, number][]} */
  const runs = [];
  found.forEach((error, i) => {
    if (Math.abs(error) <= most) return;
    const last = runs[runs.length - 1];
    if (last && last[1] === i - 1) last[1] = i;
    else runs.push([i, i]);
  });
  return runs;
}

/**
 * The error as a hill on the axis, and the curve marked where physics does not follow.
 * @param {import("./motion.js").Motion} motion @param {number} index @param {Feature} feature
 * @param {{ scale: Scale, height: number, dt: number }} where @param {number[]} curve @param {number} seconds
 */
export function errorParts(motion, index, feature, { scale, height, dt }, curve, seconds) {
  const found = errors(motion, index, curve, seconds, dt), most = LOST[feature], floor = height - BOTTOM;
  if (found.length < 2) return [];
  const tops = found.map((error, i) => `${scale.x((i + 1) * dt).toFixed(1)},${(floor - Math.min(Math.abs(error) / most, 1.5) * TALL_PX).toFixed(1)}`);
  const hill = [`${scale.x(dt)},${floor}`, ...tops, `${scale.x(found.length * dt)},${floor}`];
  const at = (/** @type {number} */ i) => curve[Math.round(Math.min(((i + 1) * dt) / seconds, 1) * (SAMPLES - 1))];
  const marks = lostRuns(found, most).map(([first, last]) => {
    const points = [];
    for (let i = first; i <= last; i++) points.push(`${scale.x((i + 1) * dt).toFixed(1)},${scale.y(at(i)).toFixed(1)}`);
    return polyline("lost", points, "The body does not follow the curve here.");
  });
  return [{ name: "polygon", attributes: { class: "error", points: hill.join(" ") } }, ...marks];
}
