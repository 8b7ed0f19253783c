// What a click or a drag in the view means for the goals of a policy, and what is said of them.

/** @typedef {[number, number, number]} Point m, world */
/** @typedef {{ orders: Record<string, number>, speed?: [number, number], slack?: number, radius_m?: number }} Goal settings, and how many numbers an order has by name */
/** @typedef {{ order: Record<string, any>, reached_after_s: number | null }} Told */

const FAR_M = 30; // nothing is asked for farther away than this
const DEGREES = 180 / Math.PI;
/** @type {Record<string, string>} */
const TITLES = {
  target_location: "Go to a place", target_heading: "Walk along a direction", aiming: "Aim the right arm",
  tennis_swing: "Hit the ball to a place", juggling: "Juggle",
};

/** @param {string} name */
export function title(name) { return TITLES[name] ?? name.replaceAll("_", " "); }

/** The goal that takes a place on the floor, and its number's name. @param {Record<string, Goal>} goals @returns {[string, string] | null} */
export function floorGoal(goals) {
  for (const [name, { orders }] of Object.entries(goals)) {
    const key = Object.keys(orders).find((number) => orders[number] === 2);
    if (key) return [name, key];
  }
  return null;
}

/** The goals with a direction, in their order. @param {Record<string, Goal>} goals */
export function directions(goals) { return Object.keys(goals).filter((name) => "yaw_deg" in goals[name].orders); }

/** A place on the floor that is not too far from the body. @param {number[]} body @param {number[]} place @returns {[number, number]} */
export function near(body, place) {
  const dx = place[0] - body[0], dy = place[1] - body[1], far = Math.hypot(dx, dy), share = Math.min(1, FAR_M / Math.max(far, 1e-6));
  return [body[0] + share * dx, body[1] + share * dy];
}

/** The time that the way takes at the speed that the policy was trained for. @param {number[]} body @param {number[]} place @param {Goal} goal */
export function placeOrder(body, place, goal) {
  const [slow, fast] = goal.speed ?? [1, 1], way = Math.hypot(place[0] - body[0], place[1] - body[1]);
  return { place: place.map(rounded), within_s: rounded(Math.max(1, (way * (goal.slack ?? 1)) / ((slow + fast) / 2))) };
}

/** Along the way from the body to a place; how far off that is says how fast. @param {number[]} body @param {number[]} place @param {Goal} goal */
export function headingOrder(body, place, goal) {
  const dx = place[0] - body[0], dy = place[1] - body[1], [slow, fast] = goal.speed ?? [1, 1];
  return { yaw_deg: rounded(Math.atan2(dy, dx) * DEGREES), speed: rounded(Math.min(Math.max(Math.hypot(dx, dy), slow), fast)) };
}

/** Along a direction in space. @param {number[]} along */
export function aimOrder([x, y, z]) {
  return { yaw_deg: rounded(Math.atan2(y, x) * DEGREES), pitch_deg: rounded(Math.atan2(z, Math.hypot(x, y)) * DEGREES) };
}

/** Where a ray meets the floor; null above the horizon. @param {Point} origin @param {Point} along @returns {[number, number] | null} */
export function onFloor(origin, along) {
  if (along[2] > -1e-3) return null;
  const far = -origin[2] / along[2];
  return [origin[0] + far * along[0], origin[1] + far * along[1]];
}

/** From the centre to where a ray meets a sphere first, or comes nearest. @param {Point} origin @param {Point} along unit vector @param {Point} centre @param {number} radius @returns {Point} */
export function onSphere(origin, along, centre, radius) {
  const to = centre.map((c, i) => c - origin[i]), middle = to.reduce((sum, v, i) => sum + v * along[i], 0);
  const gap = Math.max(0, to.reduce((sum, v) => sum + v * v, 0) - middle * middle);
  const back = Math.sqrt(Math.max(0, radius * radius - gap));
  return /** @type {Point} */ (origin.map((o, i) => o + (middle - back) * along[i] - centre[i]));
}

/** What it is told, and what came of it. @param {Told | null} told @param {number[]} body */
export function words(told, body) {
  if (!told) return "not told yet: targets of its own";
  const { place, land, yaw_deg: yaw, pitch_deg: pitch, speed } = told.order;
  const parts = [];
  if (place) parts.push(told.reached_after_s === null ? `${Math.hypot(place[0] - body[0], place[1] - body[1]).toFixed(1)} m away` : `reached after ${told.reached_after_s.toFixed(1)} s`);
  if (land) parts.push(`at ${land[0].toFixed(1)}, ${land[1].toFixed(1)} m`);
  if (yaw !== undefined) parts.push(`${yaw.toFixed(0)}°`);
  if (pitch !== undefined) parts.push(`${pitch.toFixed(0)}° up`);
  if (typeof speed === "number") parts.push(`${speed.toFixed(1)} m/s`);
  return parts.join(", ");
}

/** @param {number} value */
function rounded(value) { return Math.round(1000 * value) / 1000; }
