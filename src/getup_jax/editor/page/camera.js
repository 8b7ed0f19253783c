// Where the camera stands, and how fingers move it.

import { heightAt } from "./height.js";

const CLEAR_M = 0.25; // the camera stays as far above the ground
const APART_M = 1.3; // from variant to variant, where they are side by side
const ROOM_M = 1; // for half of a body at either end of their row

/** How much farther the camera goes when one of two fingers moves. @param {PointerEvent} one @param {PointerEvent} two @param {PointerEvent} before @param {PointerEvent} now */
export function pinch(one, two, before, now) {
  const other = before === one ? two : one, apart = (/** @type {PointerEvent} */ e) => Math.hypot(e.clientX - other.clientX, e.clientY - other.clientY);
  return apart(before) / Math.max(apart(now), 1);
}

/** How far a variant stands to the side (m), where they are side by side: the camera looks at the middle of the row. @param {number} i @param {number} count */
export function asideOf(i, count) { return (i - (count - 1) / 2) * APART_M; }

/** From where the whole row is seen (m). @param {number} count @param {number} half of the width that is seen from 1 m, m */
export function rowDistance(count, half) { return (asideOf(count - 1, count) + ROOM_M) / half; }

/** Where the camera stands (m): on its orbit, but never below the ground. @param {{ x: number, y: number, z: number }} target @param {{ azimuth: number, elevation: number, distance: number }} orbit @param {any} ground @returns {[number, number, number]} */
export function cameraAt(target, { azimuth, elevation, distance }, ground) {
  const flat = distance * Math.cos(elevation);
  const x = target.x + flat * Math.cos(azimuth), y = target.y + flat * Math.sin(azimuth);
  const level = ground ? heightAt(ground, x, y) : 0;
  return [x, y, Math.max(target.z + distance * Math.sin(elevation), level + CLEAR_M)];
}
