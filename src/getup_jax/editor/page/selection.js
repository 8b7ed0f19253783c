// Edits of the keys that are selected: pure functions of a content and the selected keys of each curve.

import { keysIn, withKeys } from "./content.js";
import { clamp } from "./features.js";
import { GAP } from "./keys.js";
import { FEATURES } from "./spline.js";

/** @import { Content, Feature, Key, Kind } from "./types.js" */

/** @typedef {Partial<Record<Feature, number[]>>} Picked numbers of keys in rising order */
/** @typedef {Partial<Record<Feature, Key[]>>} Clip times from the first of them on, in seconds */

/** @param {Picked} picked */
export function count(picked) { return FEATURES.reduce((sum, feature) => sum + (picked[feature]?.length ?? 0), 0); }

/** Every key of the curves that `change` gives new keys to. @param {Content} now @param {Picked} picked @param {(keys: Key[], chosen: number[], feature: Feature) => Key[]} change */
function each(now, picked, change) {
  /** @type {Partial<Record<Feature, Key[]>>} */
  const changed = {};
  for (const feature of FEATURES) {
    const chosen = picked[feature];
    if (chosen?.length) changed[feature] = change(keysIn(now, feature), chosen, feature);
  }
  return withKeys(now, changed);
}

/** Times that keep their order: nothing passes a key, and both ends of a curve stay. @param {Key[]} keys @param {number[]} chosen @param {(key: Key) => number} to */
function times(keys, chosen, to) {
  const free = chosen.filter((i) => i > 0 && i < keys.length - 1);
  const wanted = keys.map((key, i) => (free.includes(i) ? to(key) : key.time));
  for (const i of free) {
    let next = i + 1;
    while (free.includes(next)) next++;
    wanted[i] = clamp(wanted[i], wanted[i - 1] + GAP, keys[next].time - (next - i) * GAP);
  }
  return wanted;
}

/** Moved in time (share of the duration) and value. @param {Content} now @param {Picked} picked @param {number} time @param {Partial<Record<Feature, number>>} values */
export function move(now, picked, time, values) {
  return each(now, picked, (keys, chosen, feature) => {
    const moved = times(keys, chosen, (key) => key.time + time);
    return keys.map((key, i) => (chosen.includes(i) ? { ...key, time: moved[i], value: key.value + (values[feature] ?? 0) } : key));
  });
}

/** Times scaled about a time, and values of some curves about a value. @param {Content} now @param {Picked} picked @param {{ time?: number, factor?: number, values?: Partial<Record<Feature, { about: number, factor: number }>> }} by */
export function scale(now, picked, { time = 0, factor = 1, values = {} }) {
  return each(now, picked, (keys, chosen, feature) => {
    const moved = times(keys, chosen, (key) => time + factor * (key.time - time));
    const { about, factor: grow } = values[feature] ?? { about: 0, factor: 1 };
    return keys.map((key, i) => (chosen.includes(i) ? { ...key, time: moved[i], value: about + grow * (key.value - about) } : key));
  });
}

/** @param {Content} now @param {Picked} picked @param {Kind} kind */
export function passing(now, picked, kind) {
  return each(now, picked, (keys, chosen) => keys.map((key, i) => (chosen.includes(i) ? { ...key, kind } : key)));
}

/** Without the selected keys; the ends of a curve stay. @param {Content} now @param {Picked} picked */
export function remove(now, picked) {
  return each(now, picked, (keys, chosen) => keys.filter((_, i) => i === 0 || i === keys.length - 1 || !chosen.includes(i)));
}

/** The number typed: one value for all that are selected, or the time (share) of the first of each curve, which the others go with. @param {Content} now @param {Picked} picked @param {{ time?: number, value?: number }} typed */
export function place(now, picked, { time, value }) {
  return each(now, picked, (keys, chosen) => {
    const first = keys[chosen.find((i) => i > 0) ?? 0], to = (/** @type {Key} */ key) => key.time + (time ?? 0) - first.time;
    const moved = time === undefined ? keys.map((key) => key.time) : times(keys, chosen, to);
    return keys.map((key, i) => (chosen.includes(i) ? { ...key, time: moved[i], value: value ?? key.value } : key));
  });
}

/** What is selected, for another curve, variant or time. @param {Content} now @param {Picked} picked @returns {Clip} */
export function copy(now, picked) {
  const seconds = now.curve.durations[0];
  const first = Math.min(...FEATURES.flatMap((f) => (picked[f] ?? []).map((i) => keysIn(now, f)[i].time)));
  /** @type {Clip} */
  const clip = {};
  for (const feature of FEATURES) {
    if (picked[feature]?.length) clip[feature] = picked[feature].map((i) => ({ ...keysIn(now, feature)[i] })).map((key) => ({ ...key, time: (key.time - first) * seconds }));
  }
  return clip;
}

/** A clip of one curve for the curve whose keys are selected alone, where both are angles. @param {Clip} clip @param {Picked} picked @returns {Clip} */
export function onto(clip, picked) {
  const from = FEATURES.filter((feature) => clip[feature]?.length), to = FEATURES.filter((feature) => picked[feature]?.length);
  if (from.length !== 1 || to.length !== 1 || [from[0], to[0]].includes("height")) return clip;
  return { [to[0]]: clip[from[0]] };
}

/** A clip from a time (share) on; what lay in its place goes, and so does what reaches past the end. @param {Content} now @param {Clip} clip @param {number} at */
export function paste(now, clip, at) {
  const seconds = now.curve.durations[0];
  /** @type {Partial<Record<Feature, Key[]>>} */
  const changed = {};
  for (const feature of FEATURES) {
    const own = (clip[feature] ?? []).map((key) => ({ ...key, time: at + key.time / seconds }));
    const inside = own.filter(({ time }) => time > GAP && time < 1 - GAP);
    if (!inside.length) continue;
    const from = inside[0].time - GAP, to = inside[inside.length - 1].time + GAP;
    const keys = keysIn(now, feature);
    const rest = keys.filter(({ time }, i) => i === 0 || i === keys.length - 1 || time < from || time > to);
    changed[feature] = [...rest, ...inside].sort((a, b) => a.time - b.time);
  }
  return withKeys(now, changed);
}

/** The keys that a paste has put there. @param {Content} now @param {Clip} clip @param {number} at @returns {Picked} */
export function pasted(now, clip, at) {
  const seconds = now.curve.durations[0];
  return Object.fromEntries(FEATURES.map((feature) => {
    const own = (clip[feature] ?? []).map((key) => at + key.time / seconds), room = GAP / 2;
    const among = (/** @type {Key} */ key) => own.length > 0 && key.time > own[0] - room && key.time < own[own.length - 1] + room;
    return [feature, keysIn(now, feature).flatMap((key, i) => (among(key) ? [i] : []))];
  }));
}

/** The keys of a curve that lie in a box of time (share) and value. @param {Key[]} keys @param {number[]} from @param {number[]} to */
export function inside(keys, from, to) {
  const between = (/** @type {number} */ x, /** @type {number} */ a, /** @type {number} */ b) => x >= Math.min(a, b) && x <= Math.max(a, b);
  return keys.flatMap((key, i) => (between(key.time, from[0], to[0]) && between(key.value, from[1], to[1]) ? [i] : []));
}

/** The keys with one more, or one less of them. @param {Picked} picked @param {Feature} feature @param {number} i @returns {Picked} */
export function toggled(picked, feature, i) {
  const own = picked[feature] ?? [];
  const changed = own.includes(i) ? own.filter((j) => j !== i) : [...own, i].sort((a, b) => a - b);
  return { ...picked, [feature]: changed };
}

/** How many keys each curve has. @param {Content} now @returns {number[]} */
export function lengths(now) { return FEATURES.map((feature) => keysIn(now, feature).length); }

/** What is still there of a selection: a curve that has more or fewer keys than before has others at their numbers. @param {Content} now @param {Picked} picked @param {number[]} before lengths when they were selected @returns {Picked} */
export function valid(now, picked, before) {
  const there = lengths(now);
  return Object.fromEntries(FEATURES.map((feature, f) => [feature, there[f] === before[f] ? picked[feature] ?? [] : []]));
}
