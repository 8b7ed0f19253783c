// The style curves, as getup_jax/motion/curves.py defines them: nine control points, uniform cubic
// B-spline, phantom end points 2 p0 - p1, so that a curve starts and ends at its first and last point.

export const POINTS = 9;
/** @type {import("./types.js").Feature[]} */
export const FEATURES = ["height", "side_angle", "front_angle"];

/** What each control point counts for at a phase. @param {number} s */
export function weights(s) {
  const u = Math.min(Math.max(s, 0), 1) * (POINTS - 1);
  const w = Array.from({ length: POINTS + 2 }, (_, i) => bump(u - (i - 1)));
  const inner = w.slice(1, -1);
  inner[0] += 2 * w[0];
  inner[1] -= w[0];
  inner[POINTS - 1] += 2 * w[POINTS + 1];
  inner[POINTS - 2] -= w[POINTS + 1];
  return inner;
}

/** @param {number} x */
function bump(x) {
  const a = Math.abs(x);
  if (a < 1) return 2 / 3 - a * a + (a * a * a) / 2;
  return a < 2 ? (2 - a) ** 3 / 6 : 0;
}

// Weights of the control points at 129 equal steps of the phase.
export const TABLE = Array.from({ length: 129 }, (_, i) => weights(i / 128));

/** The curve at 129 equal steps of the phase. @param {number[]} points */
export function sample(points) {
  return TABLE.map((w) => w.reduce((sum, weight, i) => sum + weight * points[i], 0));
}
