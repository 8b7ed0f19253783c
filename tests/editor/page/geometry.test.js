import assert from "node:assert/strict";
import { test } from "node:test";

import { close } from "./samples.js";
import { asideOf, cameraAt, rowDistance } from "../../../src/getup_jax/editor/page/camera.js";
import { contacts, reached, wordOf } from "../../../src/getup_jax/editor/page/contacts.js";
import { around, pinched, Scale, snapped, timeTicks, within, zoomed } from "../../../src/getup_jax/editor/page/graph_scale.js";
import { featuresAt } from "../../../src/getup_jax/editor/page/motion_recording.js";
import { errorParts, errors, lostRuns } from "../../../src/getup_jax/editor/page/panel_motion.js";

test("a scale turns places into times and values, and back", () => {
  const scale = new Scale(500, 200, [1, 4], [-0.2, 1.8]);
  for (const [time, value] of [[1, 0], [2.5, 1], [4, 1.8]]) close([scale.time(scale.x(time)), scale.value(scale.y(value))], [time, value]);
});

test("zooming keeps what is under the pointer and stays inside the motion", () => {
  const [low, high] = zoomed([0, 4], 1, 0.5);
  assert.deepEqual([low, high], [0.5, 2.5]);
  assert.deepEqual(within([-3, -1], 6), [0, 2]);
  assert.deepEqual(within([5, 9], 6), [2, 6]);
  assert.deepEqual(within([0, 99], 6), [0, 6]);
  const [a, b] = within([1, 1.001], 6);
  assert.ok(b - a > 0.19);
});

test("a panel shows all of the curve, beyond its keys, too", () => {
  const key = (time, value) => ({ time, value, kind: "auto" });
  const range = around([key(0, 0), key(0.05, 1.65), key(0.5, 1.7), key(1, 1.5)], { low: 0, high: 1.7 });
  assert.ok(range[1] > 2, `${range}`); // the curve bends over its second key
  close(around([key(0, 0.1), key(0.5, 0.2), key(1, 0.1)], { low: 0, high: 1.7 }), [-0.102, 1.802]);
});

test("what lies between two fingers stays there, however they move", () => {
  const scale = new Scale(500, 200, [1, 4], [0, 1]);
  for (const [other, before, now] of [[[100, 50], [300, 60], [400, 60]], [[300, 50], [100, 50], [160, 90]], [[200, 50], [200, 90], [200, 150]]]) {
    const middle = scale.time((other[0] + before[0]) / 2);
    const after = new Scale(500, 200, pinched(scale, other, before, now), [0, 1]);
    assert.ok(Math.abs(after.time((other[0] + now[0]) / 2) - middle) < 1e-9);
  }
  const [low, high] = pinched(scale, [100, 50], [200, 50], [300, 50]);
  assert.ok(Math.abs(high - low - 1.5) < 1e-9, "twice as far apart shows half of the time");
});

test("ticks are few and at round times", () => {
  assert.deepEqual(timeTicks([0, 6], 8), [0, 1, 2, 3, 4, 5, 6]);
  assert.deepEqual(timeTicks([1.1, 1.5], 5), [1.1, 1.2, 1.3, 1.4, 1.5]);
  for (const span of [0.3, 1, 7, 23]) assert.ok(timeTicks([0, span], 10).length <= 12);
  assert.ok(Math.abs(snapped(0.1234, 0.01) - 0.12) < 1e-12);
});

test("the camera stays above the ground, flat or not, wherever it is turned", () => {
  const hill = { origin: [-5, -5], step: 1, points: 11, heights: Array.from({ length: 121 }, (_, i) => (i % 11 > 7 ? 3 : 0)) };
  for (let azimuth = 0; azimuth < 6.3; azimuth += 0.3) {
    for (const elevation of [-0.05, 0.3, 1.2]) {
      const orbit = { azimuth, elevation, distance: 4.2 }, [x, , z] = cameraAt({ x: 0, y: 0, z: 0.6 }, orbit, hill);
      assert.ok(z >= (Math.round(x + 5) > 7 ? 3 : 0) + 0.2);
      assert.ok(cameraAt({ x: 0, y: 0, z: 0.6 }, orbit, null)[2] >= 0.2);
    }
  }
});

test("variants side by side are all seen, whichever is edited", () => {
  const half = Math.tan((19 * Math.PI) / 180) * 1.4; // of a view of 654 x 467
  for (const count of [2, 3, 4]) {
    const places = Array.from({ length: count }, (_, i) => asideOf(i, count)), seen = half * rowDistance(count, half);
    close([places[0] + places[count - 1]], [0]);
    assert.ok(places.every((place) => Math.abs(place) + 0.9 < seen));
  }
});

test("contacts are the links on the ground, turned as they are and on hills", () => {
  const capsule = { link: 0, kind: "capsule", size: [0.05, 0.2], position: [0, 0, 0], quaternion: [1, 0, 0, 0] };
  const scene = { shapes: [capsule], links: ["foot_l"] }, upright = [0, 0, 0.25, 1, 0, 0, 0], lying = [0, 0, 0.25, Math.SQRT1_2, Math.SQRT1_2, 0, 0];
  const touching = (pose, ground = null) => contacts(scene, Float32Array.from(pose), ground);
  assert.deepEqual(touching(upright), ["left foot"]);
  assert.deepEqual(touching(lying), []);
  assert.deepEqual(touching(lying, { origin: [-1, -1], step: 1, points: 3, heights: Array(9).fill(0.2) }), ["left foot"]);
});

test("a recording has height and angles at a share of its time", () => {
  const frames = Float32Array.from({ length: 3 * 10 }, (_, i) => i);
  assert.deepEqual([0, 0.4, 1].map((share) => [...featuresAt({ fps: 30, total: 3, links: 1, frames }, share)]), [[7, 8, 9], [17, 18, 19], [27, 28, 29]]);
});

test("every part of the body has a word", () => {
  const limbs = ["shoulder", "arm", "forearm", "hand", "thigh", "shin", "foot"], sides = { l: /^left /, r: /^right / };
  for (const limb of limbs) for (const [side, word] of Object.entries(sides)) assert.match(wordOf(`${limb}_${side}`), word);
  assert.deepEqual(["pelvis", "spine_low", "spine_mid", "spine_upper", "neck", "head"].map(wordOf), ["pelvis", "torso", "torso", "torso", "neck", "head"]);
});

test("of a wished pose one sees which contacts were there for half of the time", () => {
  const shape = (link) => ({ link, kind: "sphere", size: [0.05], position: [0, 0, 0], quaternion: [1, 0, 0, 0] });
  const scene = { shapes: [shape(0), shape(1)], links: ["hand_l", "hand_r"] };
  const heights = [[0.05, 0.5], [0.05, 0.5], [0.05, 0.05], [0.5, 0.5]];
  const motion = { count: 4, ground: null, pose: (i) => Float32Array.from(heights[i].flatMap((z) => [0, 0, z, 1, 0, 0, 0])) };
  const wish = { name: "", from: 0.25, to: 1, contacts: ["left hand", "right hand"] };
  assert.deepEqual(reached(scene, motion, wish, { seconds: 4, dt: 1 }), { reached: ["left hand"], missed: ["right hand"], others: [] });
  assert.deepEqual(reached(scene, motion, { ...wish, contacts: [] }, { seconds: 4, dt: 1 }).others, ["left hand"]);
});

test("where physics does not follow is said in runs of frames", () => {
  assert.deepEqual(lostRuns([0, 0.2, -0.3, 0.1, 0.16], 0.15), [[1, 2], [4, 4]]);
});

test("the error is a hill below the curve, and the curve is marked where physics does not follow", () => {
  // a level curve of 1 m for 3 s at 1 frame/s; in the second frame the body is .3 m below it
  const curve = Array(129).fill(1), motion = /** @type {any} */ ({ count: 3, features: [[1, 0.7, 1.05]] });
  close(errors(motion, 0, curve, 3, 1), [0, -0.3, 0.05]);
  const scale = new Scale(352, 142, [0, 3], [0, 2]), parts = errorParts(motion, 0, "height", { scale, height: 142, dt: 1 }, curve, 3);
  assert.deepEqual(parts.map(({ attributes }) => attributes.class), ["error", "lost"]);
  const [hill, lost] = parts.map(({ attributes }) => String(attributes.points).split(" ").map((pair) => pair.split(",").map(Number)));
  const floor = 122, tops = hill.slice(1, -1).map(([, y]) => floor - y);
  assert.ok(tops[0] === 0 && tops[1] > tops[2] && tops[2] > 0, `${tops}`);
  assert.deepEqual(lost, [[scale.x(2), scale.y(1)]], "at the frame, on the curve");
  motion.features = [[1, 0.99, 1.05]];
  assert.deepEqual(errorParts(motion, 0, "height", { scale, height: 142, dt: 1 }, curve, 3).map(({ attributes }) => attributes.class), ["error"]);
});
