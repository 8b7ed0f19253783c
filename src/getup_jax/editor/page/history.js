// Undo and redo of one variant: contents that are never changed in place.

/** @import { Content, History } from "./types.js" */

const MOST_STEPS = 200;
const ONE_STEP_MS = 1200; // edits of the same kind that follow each other as fast are one step

/** @param {Content} now @returns {History} */
export function begin(now) { return { now, past: [], future: [], tag: "", at: 0 }; }

/**
 * A finished edit. The tag names what goes on being edited, as by a key that is held: then undo takes
 * all of it back at once.
 * @param {History} history @param {Content} now @param {string} tag @param {number} at ms
 * @returns {History}
 */
export function record(history, now, tag = "", at = 0) {
  if (same(history.now, now)) return history;
  const goesOn = tag !== "" && tag === history.tag && at - history.at < ONE_STEP_MS && history.past.length > 0;
  const past = goesOn ? history.past : [...history.past, history.now].slice(-MOST_STEPS);
  return { now, past, future: [], tag, at };
}

/** @param {History} history @returns {History} */
export function undo({ now, past, future, ...rest }) {
  if (!past.length) return { now, past, future, ...rest };
  return { now: past[past.length - 1], past: past.slice(0, -1), future: [...future, now], tag: "", at: 0 };
}

/** @param {History} history @returns {History} */
export function redo({ now, past, future, ...rest }) {
  if (!future.length) return { now, past, future, ...rest };
  return { now: future[future.length - 1], past: [...past, now], future: future.slice(0, -1), tag: "", at: 0 };
}

/** @param {Content} a @param {Content} b */
function same(a, b) { return a === b || JSON.stringify(a) === JSON.stringify(b); }
