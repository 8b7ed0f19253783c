// What touches the ground: the links whose lowest shape is as near to it as a contact is.

import { heightAt } from "./height.js";

const NEAR_M = 0.015;
const WORDS = {
  hand_r: "right hand", hand_l: "left hand", lower_arm_r: "right forearm", lower_arm_l: "left forearm", forearm_r: "right forearm", forearm_l: "left forearm",
  arm_r: "right upper arm", arm_l: "left upper arm", shoulder_r: "right shoulder", shoulder_l: "left shoulder",
  shin_r: "right knee", shin_l: "left knee", foot_r: "right foot", foot_l: "left foot", thigh_r: "right hip", thigh_l: "left hip",
  pelvis: "pelvis", neck: "neck", head: "head", spine_low: "torso", spine_mid: "torso", spine_upper: "torso", chest: "torso", torso: "torso",
};

/** The lowest point (m) of a shape on a link. @param {any} shape @param {ArrayLike<number>} pose position and quaternion (wxyz) */
function lowest({ kind, size, position, quaternion }, pose) {
  const [x, y, z, ...link] = Array.from(pose), place = turn(link, position);
  const axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis) => Math.abs(turn(link, turn(quaternion, axis))[2]));
  const middle = z + place[2];
  if (kind === "sphere") return { x: x + place[0], y: y + place[1], z: middle - size[0] };
  if (kind === "capsule") return { x: x + place[0], y: y + place[1], z: middle - size[0] - size[1] * axes[2] };
  return { x: x + place[0], y: y + place[1], z: middle - axes.reduce((sum, a, i) => sum + a * size[i], 0) };
}

/** A vector turned by a quaternion (wxyz). @param {number[]} q @param {number[]} v */
export function turn([w, x, y, z], v) {
  const t = [2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])];
  return [v[0] + w * t[0] + y * t[2] - z * t[1], v[1] + w * t[1] + z * t[0] - x * t[2], v[2] + w * t[2] + x * t[1] - y * t[0]];
}

/** @param {string} link */
export function wordOf(link) { return /** @type {Record<string, string>} */ (WORDS)[link] ?? link.replaceAll("_", " "); }

/** Words for the links on the ground in a pose. @param {{ shapes: any[], links: string[] }} scene @param {Float32Array} values @param {any} ground null: flat */
export function contacts({ shapes, links }, values, ground) {
  const found = new Set();
  for (const shape of shapes) {
    const { x, y, z } = lowest(shape, values.subarray(7 * shape.link, 7 * shape.link + 7));
    if (z - (ground ? heightAt(ground, x, y) : 0) < NEAR_M) found.add(wordOf(links[shape.link]));
  }
  return [...found];
}

/** Of a wish's contacts, those that touched the ground for at least half of its time, and those that did not. @param {any} scene @param {import("./motion.js").Motion} motion @param {import("./types.js").Wish} wish @param {{ seconds: number, dt: number }} of */
export function reached(scene, motion, wish, { seconds, dt }) {
  const frame = (/** @type {number} */ share) => Math.min(Math.max(Math.round((share * seconds) / dt) - 1, 0), motion.count - 1);
  const [first, last] = [frame(wish.from), frame(wish.to)];
  /** @type {Map<string, number>} */
  const times = new Map();
  for (let i = first; i <= last; i++) for (const word of contacts(scene, motion.pose(i), motion.ground)) times.set(word, (times.get(word) ?? 0) + 1);
  const half = (last - first + 1) / 2, there = (/** @type {string} */ word) => (times.get(word) ?? 0) >= half;
  return { reached: wish.contacts.filter(there), missed: wish.contacts.filter((word) => !there(word)), others: [...times.keys()].filter((word) => there(word) && !wish.contacts.includes(word)) };
}
