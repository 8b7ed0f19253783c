// How far a start pose is from where the curves begin.

import { keysIn } from "./content.js";

/** @import { Content } from "./types.js" */

/** The larger difference of both angles (degrees). @param {Content} now @param {number[]} first height (m), side and front angle (degrees) of a pose */
export function startGap(now, first) {
  const [side, front] = [keysIn(now, "side_angle")[0].value, keysIn(now, "front_angle")[0].value];
  return Math.max(Math.abs(side - first[1]), Math.abs(front - first[2]));
}
