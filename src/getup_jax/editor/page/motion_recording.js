// The motion behind a curve: of a clip that was imported, or of the library.

/** @import { Recording } from "./types.js" */

/** Link poses of a recording at a time, 7 numbers a link. @param {Recording} recording @param {number} share of its duration, 0 to 1 */
export function poseAt({ frames, total, links }, share) {
  const width = links * 7 + 3, frame = frameAt(total, share);
  return frames.subarray(frame * width, frame * width + links * 7);
}

/** Height (m) and angles (degrees) of a recording at a time. @param {Recording} recording @param {number} share of its duration, 0 to 1 */
export function featuresAt({ frames, total, links }, share) {
  const end = (frameAt(total, share) + 1) * (links * 7 + 3);
  return frames.subarray(end - 3, end);
}

/** @param {number} total @param {number} share */
export function frameAt(total, share) { return Math.min(Math.max(Math.round(share * (total - 1)), 0), total - 1); }
