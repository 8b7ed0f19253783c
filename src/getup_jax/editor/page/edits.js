// Edits of a variant's content. Each makes a new content and leaves the old one as it is.

import { duration, keptDuration, keysIn, plain, withKeys } from "./content.js";
import { clamp } from "./features.js";
import { GAP, valueAt } from "./keys.js";
import { FEATURES } from "./spline.js";

/** @import { Content, Curve, Feature, Key } from "./types.js" */

/** @typedef {{ joint: number[], sign: number[] }} Mirror */
/** @typedef {Partial<Record<Feature, number>>} Values */

/** @param {Content} now @param {Curve} curve @returns {Content} */
export function choose(now, curve) {
  const own = plain(curve);
  return { ...now, curve: own, keys: {}, reference: own, wishes: [] };
}

/** @param {Content} now @returns {Content} */
export function reset(now) { return { ...now, curve: now.reference, keys: {}, wishes: [] }; }

/** @param {Content} now @param {Partial<Curve>} changed @returns {Content} */
export function withCurve(now, changed) { return { ...now, curve: { ...now.curve, ...changed } }; }

/** @param {Content} now @param {number} seconds */
export function last(now, seconds) { return withCurve(now, { durations: [keptDuration(seconds)] }); }

/** Another time for every key of all curves. @param {Content} now @param {(time: number) => number} to */
function retimed(now, to) {
  /** @type {Partial<Record<Feature, Key[]>>} */
  const changed = {};
  for (const feature of FEATURES) changed[feature] = keysIn(now, feature).map((key) => ({ ...key, time: to(key.time) }));
  const wishes = now.wishes.map((wish) => ({ ...wish, from: to(wish.from), to: to(wish.to) }));
  return withKeys({ ...now, wishes }, changed);
}

/** The inner keys of all curves earlier (amount < 0) or later. @param {Content} now @param {number} amount */
export function shift(now, amount) {
  return amount === 0 ? now : retimed(now, (time) => time ** (2 ** -amount));
}

/** A part of all curves, from and to in shares of the duration, takes `factor` times as long. @param {Content} now @param {number} from @param {number} to @param {number} factor */
export function stretch(now, from, to, factor) {
  const old = duration(now), whole = keptDuration(old * (1 + (to - from) * (factor - 1)));
  const inside = (whole - old * (1 - (to - from))) / Math.max(old * (to - from), 1e-9); // as far as the longest allows
  const moved = (/** @type {number} */ time) => {
    const part = clamp(time, from, to) - from;
    return ((time - part + part * inside) * old) / whole;
  };
  return last(retimed(pinned(now, [from, to]), moved), whole);
}

/** All curves stay for some seconds as they are at a time. @param {Content} now @param {number} time @param {number} seconds */
export function hold(now, time, seconds) {
  const old = duration(now), whole = keptDuration(old + seconds), added = whole - old;
  const start = (time * old) / whole, end = (time * old + added) / whole;
  /** @type {Partial<Record<Feature, Key[]>>} */
  const changed = {};
  for (const feature of FEATURES) {
    const keys = keysIn(now, feature), value = valueAt(keys, time);
    const moved = keys.map((key) => ({ ...key, time: (key.time * old + (key.time > time ? added : 0)) / whole }));
    changed[feature] = plateau(moved, start, end, value);
  }
  const later = (/** @type {number} */ t) => (t * old + (t > time ? added : 0)) / whole;
  const wishes = now.wishes.map((one) => ({ ...one, from: later(one.from), to: later(one.to) }));
  return last(withKeys({ ...now, wishes }, changed), whole);
}

/**
 * Some curves have given values from one time to another: a pose that is wished there. It takes the place of
 * wishes at the same time.
 * @param {Content} now @param {number} from @param {number} to @param {Values} values @param {{ name: string, contacts: string[] }} [pose]
 */
export function wish(now, from, to, values, pose) {
  /** @type {Partial<Record<Feature, Key[]>>} */
  const changed = {};
  for (const feature of FEATURES) {
    const value = values[feature];
    if (value !== undefined) changed[feature] = plateau(keysIn(now, feature), from, to, value);
  }
  const others = now.wishes.filter((one) => one.to < from || one.from > to);
  const wishes = pose ? [...others, { ...pose, from, to }].sort((a, b) => a.from - b.from) : others;
  return withKeys({ ...now, wishes }, changed);
}

/** Keys with a flat part; what was there, or too near to it, goes. Both ends stay. @param {Key[]} keys @param {number} from @param {number} to @param {number} value */
function plateau(keys, from, to, value) {
  const [start, end] = [clamp(from, 0, 1), clamp(to, 0, 1)];
  const near = 0.04; // a key right beside a flat part makes the curve swing
  const others = keys.filter(({ time }, i) => {
    const outer = (i === 0 && start > GAP) || (i === keys.length - 1 && end < 1 - GAP);
    return outer || time < start - near || time > end + near;
  });
  /** @type {Key[]} */
  const flat = [{ time: start < GAP ? 0 : start, value, kind: "flat" }];
  if (end - start > GAP) flat.push({ time: end > 1 - GAP ? 1 : end, value, kind: "flat" });
  return [...others, ...flat].sort((a, b) => a.time - b.time);
}

/** Keys on the curves at some times. @param {Content} now @param {number[]} times */
function pinned(now, times) {
  let found = now;
  for (const feature of FEATURES) for (const time of times) found = add(found, feature, time);
  return found;
}

/** A key at a time, on the curve unless a value is given; none where one is already. @param {Content} now @param {Feature} feature @param {number} time @param {number} [value] */
export function add(now, feature, time, value) {
  const keys = keysIn(now, feature);
  if (time <= 0 || time >= 1 || keys.some((key) => Math.abs(key.time - time) < GAP)) return now;
  /** @type {Key} */
  const key = { time, value: value ?? valueAt(keys, time), kind: "auto" };
  return withKeys(now, { [feature]: [...keys, key].sort((a, b) => a.time - b.time) });
}

/** Height (m) and angles (degrees) of a start's pose. @param {{ starts: { name: string, first: number[] }[], mirrored: string | null }} scene @param {string} name */
export function firstOf({ starts, mirrored }, name) {
  const turned = mirrored !== null && name.startsWith(mirrored), plain = turned ? name.slice(mirrored.length) : name;
  const [height, side, front] = starts.find((s) => s.name === plain)?.first ?? [0, 90, 90];
  return [height, turned ? 180 - side : side, front];
}

/** Another start pose; the curves begin with its height and angles. @param {Content} now @param {string} name @param {number[]} first */
export function startFrom(now, name, first) {
  const { pose, ...curve } = now.curve;
  /** @type {Partial<Record<Feature, Key[]>>} */
  const changed = {};
  FEATURES.forEach((feature, i) => {
    changed[feature] = keysIn(now, feature).map((key, j) => (j ? key : { ...key, value: first[i] }));
  });
  return withKeys({ ...now, curve: { ...curve, start: name } }, changed);
}

/** Left and right swapped; `mirrored` is the word before a mirrored start, null on irregular ground, where the places are what they are. @param {Content} now @param {string | null} mirrored @param {Mirror} mirror @returns {Content} */
export function mirror(now, mirrored, mirror) {
  const turned = (/** @type {number} */ v) => Number((180 - v).toFixed(4));
  const { curve } = now, keys = { ...now.keys };
  if (keys.side_angle) keys.side_angle = keys.side_angle.map((key) => ({ ...key, value: turned(key.value) }));
  const other = { ...curve, side_angle: curve.side_angle.map(turned) };
  if (curve.pose) other.pose = mirrorPose(curve.pose, mirror);
  else if (mirrored !== null) other.start = curve.start.startsWith(mirrored) ? curve.start.slice(mirrored.length) : mirrored + curve.start;
  return { ...now, curve: other, keys };
}

/** Of a position and a quaternion (wxyz) in the plane y = 0. */
export const POSE_SIGN = [1, -1, 1, 1, -1, 1, -1];

/** @param {number[]} pose @param {Mirror} mirror */
export function mirrorPose(pose, { joint, sign }) {
  const root = POSE_SIGN.map((s, i) => s * pose[i]);
  return [...root, ...joint.map((j, i) => sign[i] * pose[7 + j])];
}
