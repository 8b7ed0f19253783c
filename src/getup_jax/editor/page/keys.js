// The drawn curve: keys that lie on it, in time (share of the duration) and value, and how it passes
// through each of them. The policy sees nine control points, which are fitted to it.
//
// Between two keys the curve is a cubic. At `auto` keys it bends evenly (a natural cubic spline), at
// `flat` ones its slope is 0, at `linear` ones it comes and goes in a straight line. Nine auto keys at
// equal distances are exactly a curve of nine control points: a uniform cubic B-spline with phantom
// ends 2 p0 - p1 is the natural cubic spline through its knots.

import { POINTS, TABLE, weights } from "./spline.js";

/** @import { Feature, Key } from "./types.js" */

export const GAP = 0.005; // keys are at least this far apart, as a share of the duration
export const SAMPLES = TABLE.length;

/** The keys of control points [9]: at the knots. @param {number[]} points @returns {Key[]} */
export function keysOf(points) {
  return points.map((_, i) => {
    const time = i / (POINTS - 1);
    return { time, value: dot(weights(time), points), kind: "auto" };
  });
}

/** Slopes into and out of every key. @param {Key[]} keys */
function slopes(keys) {
  const n = keys.length;
  /** @type {number[]} */
  const steps = [], /** @type {number[]} */ rises = [];
  for (let i = 0; i + 1 < n; i++) {
    steps.push(Math.max(keys[i + 1].time - keys[i].time, 1e-9));
    rises.push((keys[i + 1].value - keys[i].value) / steps[i]);
  }
  const into = keys.map((_, i) => rises[Math.max(i - 1, 0)]);
  const out = keys.map((_, i) => rises[Math.min(i, n - 2)]);
  keys.forEach((key, i) => { if (key.kind === "flat") into[i] = out[i] = 0; });
  for (let first = 0; first < n; first++) {
    if (keys[first].kind !== "auto") continue;
    let last = first;
    while (last + 1 < n && keys[last + 1].kind === "auto") last++;
    const found = evenSlopes(first, last, steps, rises, first > 0 ? out[first - 1] : 0, last + 1 < n ? into[last + 1] : 0);
    found.forEach((slope, i) => { into[first + i] = out[first + i] = slope; });
    first = last;
  }
  return { into, out, steps };
}

/**
 * Slopes at the auto keys first to last whose curve bends evenly (Thomas' algorithm).
 * @param {number} first @param {number} last @param {number[]} steps @param {number[]} rises
 * @param {number} before slope at the key before @param {number} after slope at the key after
 */
function evenSlopes(first, last, steps, rises, before, after) {
  /** @type {number[]} */
  const upper = [], /** @type {number[]} */ right = [];
  for (let i = first; i <= last; i++) {
    const a = i > 0 ? 1 / steps[i - 1] : 0, c = i < steps.length ? 1 / steps[i] : 0;
    let known = 3 * ((i > 0 ? a * rises[i - 1] : 0) + (c ? c * rises[i] : 0));
    if (i === first && a) known -= a * before;
    if (i === last && c) known -= c * after;
    const j = i - first, low = i > first ? a : 0;
    const pivot = 2 * (a + c) - (j ? low * upper[j - 1] : 0);
    upper.push((i < last ? c : 0) / pivot);
    right.push((known - (j ? low * right[j - 1] : 0)) / pivot);
  }
  for (let j = right.length - 2; j >= 0; j--) right[j] -= upper[j] * right[j + 1];
  return right;
}

/** The values of the drawn curve at times in rising order. @param {Key[]} keys @param {number[]} times */
export function valuesAt(keys, times) {
  const { into, out, steps } = slopes(keys);
  let i = 0;
  return times.map((time) => {
    while (i + 2 < keys.length && time > keys[i + 1].time) i++;
    const h = steps[i], u = Math.min(Math.max((time - keys[i].time) / h, 0), 1);
    const [v, w] = [keys[i].value, keys[i + 1].value];
    const a = h * out[i] - (w - v), b = -h * into[i + 1] + (w - v);
    return (1 - u) * v + u * w + u * (1 - u) * ((1 - u) * a + u * b);
  });
}

/** @param {Key[]} keys @param {number} time */
export function valueAt(keys, time) { return valuesAt(keys, [time])[0]; }

const TIMES = Array.from({ length: SAMPLES }, (_, i) => i / (SAMPLES - 1));

/** The drawn curve at 129 equal steps of time. @param {Key[]} keys */
export function drawn(keys) { return valuesAt(keys, TIMES); }

// Least squares: inner points = SOLVE (curve - what both ends add), the ends stay where they are.
const SOLVE = pseudoInverse(TABLE.map((row) => row.slice(1, -1)));

/** The control points [9] whose curve is nearest to the drawn one; both ends are kept. @param {Key[]} keys */
export function fit(keys) {
  const curve = drawn(keys), first = curve[0], last = curve[SAMPLES - 1];
  const rest = curve.map((value, i) => value - TABLE[i][0] * first - TABLE[i][POINTS - 1] * last);
  return [first, ...SOLVE.map((row) => dot(row, rest)), last];
}

/** @param {number[]} a @param {number[]} b */
function dot(a, b) { return a.reduce((sum, x, i) => sum + x * b[i], 0); }

/** (A^T A)^-1 A^T by Gauss and Jordan, for a small well-conditioned A. @param {number[][]} a */
function pseudoInverse(a) {
  const n = a[0].length;
  const rows = Array.from({ length: n }, (_, i) => [
    ...Array.from({ length: n }, (_, j) => a.reduce((sum, row) => sum + row[i] * row[j], 0)),
    ...a.map((row) => row[i]),
  ]);
  for (let i = 0; i < n; i++) {
    const scale = rows[i][i];
    rows[i] = rows[i].map((x) => x / scale);
    for (let k = 0; k < n; k++) {
      if (k === i) continue;
      const factor = rows[k][i];
      rows[k] = rows[k].map((x, j) => x - factor * rows[i][j]);
    }
  }
  return rows.map((row) => row.slice(n));
}
