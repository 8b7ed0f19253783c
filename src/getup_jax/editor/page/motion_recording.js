// The motion behind a curve: of a clip that was imported, or of the library.

import { POSE_SIGN } from "./edits.js";

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

/** @type {WeakMap<Recording, Recording>} */
const images = new WeakMap();

/** The mirror image of a recording in the plane y = 0: a link's pose is that of its image on the other side. @param {Recording} recording @param {number[]} link number of every link's image @returns {Recording} */
export function mirrored(recording, link) {
  const known = images.get(recording);
  if (known) return known;
  const { frames, total, links } = recording, width = links * 7 + 3, image = { ...recording, frames: Float32Array.from(frames) };
  for (let row = 0; row < total * width; row += width) {
    for (let i = 0; i < links; i++) {
      const from = row + 7 * (link[i] ?? i);
      POSE_SIGN.forEach((sign, j) => { image.frames[row + 7 * i + j] = sign * frames[from + j]; });
    }
    image.frames[row + width - 2] = 180 - frames[row + width - 2]; // the lean to the side
  }
  images.set(recording, image);
  return image;
}

/** @param {number} total @param {number} share */
export function frameAt(total, share) { return Math.min(Math.max(Math.round(share * (total - 1)), 0), total - 1); }
