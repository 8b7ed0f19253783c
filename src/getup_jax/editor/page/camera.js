// Where the camera stands, and how fingers move it.

import { heightAt } from "./height.js";

const CLEAR_M = 0.25; // the camera stays as far above the ground

/** How much farther the camera goes when one of two fingers moves. @param {PointerEvent} one @param {PointerEvent} two @param {PointerEvent} before @param {PointerEvent} now */
export function pinch(one, two, before, now) {
  const other = before === one ? two : one, apart = (/** @type {PointerEvent} */ e) => Math.hypot(e.clientX - other.clientX, e.clientY - other.clientY);
  return apart(before) / Math.max(apart(now), 1);
}

/** Where the camera stands (m): on its orbit, but never below the ground. @param {{ x: number, y: number, z: number }} target @param {{ azimuth: number, elevation: number, distance: number }} orbit @param {any} ground @returns {[number, number, number]} */
export function cameraAt(target, { azimuth, elevation, distance }, ground) {
  const flat = distance * Math.cos(elevation);
  const x = target.x + flat * Math.cos(azimuth), y = target.y + flat * Math.sin(azimuth);
  const level = ground ? heightAt(ground, x, y) : 0;
  return [x, y, Math.max(target.z + distance * Math.sin(elevation), level + CLEAR_M)];
}
