// Poses that curves can wish for: what height and angles such a pose has on a body of this size. Hands and
// feet find their own way: contacts cannot be asked for.

/** @import { Feature } from "./types.js" */

/** @type {{ name: string, values: Partial<Record<Feature, number>> }[]} */
export const POSES = [
  { name: "hands and knees", values: { height: 0.5, side_angle: 90, front_angle: 165 } },
  { name: "on the elbows, face down", values: { height: 0.28, side_angle: 90, front_angle: 155 } },
  { name: "sits, leaning back", values: { height: 0.5, side_angle: 90, front_angle: 60 } },
  { name: "kneels upright", values: { height: 0.95, side_angle: 90, front_angle: 95 } },
  { name: "squats", values: { height: 0.8, side_angle: 90, front_angle: 120 } },
  { name: "bends forward, legs straight", values: { height: 0.95, side_angle: 90, front_angle: 150 } },
];
