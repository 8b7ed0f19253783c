// Which known style a curve is most like: a hint at what the policy can do, since it was trained on those.

import { KINDS } from "./features.js";
import { FEATURES, sample } from "./spline.js";

/** @import { Curve } from "./types.js" */

const FAR = 0.12; // of the range of a curve, root mean square: as far from every known style the policy may fail

/** Root mean square of the difference of two curves, as shares of their ranges. @param {Curve} a @param {Curve} b */
export function distance(a, b) {
  const squares = FEATURES.flatMap((feature) => {
    const { low, high } = KINDS[feature], other = sample(b[feature]);
    return sample(a[feature]).map((value, i) => ((value - other[i]) / (high - low)) ** 2);
  });
  return Math.sqrt(squares.reduce((sum, x) => sum + x, 0) / squares.length);
}

/** @param {Curve} curve @param {Curve[]} known @returns {string} */
export function alike(curve, known) {
  const mirrored = (/** @type {Curve} */ c) => ({ ...c, side_angle: c.side_angle.map((v) => 180 - v) });
  const found = known.map((one) => ({ name: one.name, far: Math.min(distance(curve, one), distance(mirrored(curve), one)) }));
  const [nearest] = found.sort((a, b) => a.far - b.far);
  if (!nearest) return "";
  return nearest.far < FAR ? `like ${nearest.name}` : "unlike any style that the policy knows";
}
