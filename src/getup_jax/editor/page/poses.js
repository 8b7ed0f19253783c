// Poses that curves can wish for: what height and angles such a pose has on a body of this size. Hands and
// feet find their own way: contacts cannot be asked for. Hands and knees are as in the reference motions (their median).

/** @import { Feature } from "./types.js" */

const HANDS = ["left hand", "right hand"], KNEES = ["left knee", "right knee"], FEET = ["left foot", "right foot"];

/** @type {{ name: string, contacts: string[], values: Partial<Record<Feature, number>> }[]} */
export const POSES = [
  { name: "hands and knees", contacts: [...HANDS, ...KNEES], values: { height: 0.53, side_angle: 90, front_angle: 169 } },
  { name: "on the elbows, face down", contacts: ["left forearm", "right forearm"], values: { height: 0.28, side_angle: 90, front_angle: 155 } },
  { name: "sits, leaning back", contacts: ["pelvis"], values: { height: 0.5, side_angle: 90, front_angle: 60 } },
  { name: "kneels upright", contacts: KNEES, values: { height: 0.95, side_angle: 90, front_angle: 95 } },
  { name: "squats", contacts: FEET, values: { height: 0.8, side_angle: 90, front_angle: 120 } },
  { name: "bends forward, legs straight", contacts: FEET, values: { height: 0.95, side_angle: 90, front_angle: 150 } },
];
