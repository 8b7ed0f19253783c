// A variant's content: how it begins, what the policy sees of it, and what is asked for it.

import { clamp, kept, KINDS } from "./features.js";
import { drawn, fit, keysOf } from "./keys.js";
import { FEATURES, sample } from "./spline.js";

/** @import { Content, Curve, Feature, Key } from "./types.js" */

export const DURATION_S = [0.5, 20];
const POINT_LIMITS = { height: [-0.5, 2.5], side_angle: [-90, 270], front_angle: [-90, 270] }; // of curve files
const MOST_LETTERS = 80;
const LEAST_ROOM = 1e-4; // between two keys, as a share of the duration

/** @param {Curve} curve @returns {Content} */
export function contentOf(curve) {
  const own = plain(curve);
  return { curve: own, keys: {}, reference: own, region: 0, place: 0, wishes: [] };
}

/** A curve of its own with one duration, the middle one of a file's. @param {Curve} curve @returns {Curve} */
export function plain(curve) {
  const copy = structuredClone(curve);
  copy.durations = [copy.durations[Math.floor((copy.durations.length - 1) / 2)]];
  return copy;
}

/** Whether two curves are one, as for the imports of two files that have one name. @param {Curve} a @param {Curve} b */
export function sameCurve(a, b) { return a.name === b.name && JSON.stringify(plain(a)) === JSON.stringify(plain(b)); }

/** The keys of a feature: the ones that were drawn, or those of its control points. @param {Content} now @param {Feature} feature @returns {Key[]} */
export function keysIn(now, feature) { return now.keys[feature] ?? keysOf(now.curve[feature]); }

/** The same content with other keys, and the control points that are nearest to them. @param {Content} now @param {Partial<Record<Feature, Key[]>>} changed @returns {Content} */
export function withKeys(now, changed) {
  const keys = { ...now.keys }, curve = { ...now.curve };
  for (const feature of FEATURES) {
    const drawnKeys = changed[feature];
    if (!drawnKeys) continue;
    keys[feature] = rising(drawnKeys).map((key) => ({ ...key, value: kept(feature, key.value) }));
    const [low, high] = POINT_LIMITS[feature];
    curve[feature] = fit(keys[feature]).map((v) => clamp(Number(v.toFixed(KINDS[feature].digits + 1)), low, high));
  }
  return { ...now, keys, curve };
}

/** Keys whose times rise from 0 to 1 exactly, whatever was rounded: what was pressed together, as by a shift that is made again and again, keeps a little room. @param {Key[]} keys */
function rising(keys) {
  const end = keys.length - 1, room = Math.min(LEAST_ROOM, 1 / (2 * keys.length));
  let before = 0;
  return keys.map((key, i) => {
    before = i === 0 ? 0 : i === end ? 1 : clamp(key.time, before + room, 1 - (end - i) * room);
    return before === key.time ? key : { ...key, time: before };
  });
}

/** How far the curve that the policy sees is from the drawn one at most. @param {Content} now @param {Feature} feature */
export function misfit(now, feature) {
  const keys = now.keys[feature];
  if (!keys) return 0;
  const seen = sample(now.curve[feature]);
  return Math.max(...drawn(keys).map((value, i) => Math.abs(value - seen[i])));
}

/** @param {Content} now */
export function duration(now) { return now.curve.durations[0]; }

/** A duration as it is stored; the shortest for what is no number. @param {number} seconds */
export function keptDuration(seconds) { return clamp(Number(seconds.toFixed(2)) || DURATION_S[0], DURATION_S[0], DURATION_S[1]); }

/** What a name may not have is left out. @param {string} text */
export function keptName(text) { return text.normalize("NFC").replace(/[^\p{L}\p{M}\p{N}_.@:~ -]/gu, "").slice(0, MOST_LETTERS); }

/** What the server needs for a motion: names change none. @param {Content} now */
export function asked(now) {
  const { curve: { name, strategy, ...curve }, region, place } = now;
  return { curve, region, place };
}
