// Steering without a browser: what a click and a drag mean, and which frame is due.

import assert from "node:assert/strict";
import { test } from "node:test";

import { close } from "./samples.js";
import { Buffer } from "../../../src/getup_jax/editor/page/steer_buffer.js";
import { aimOrder, directions, floorGoal, headingOrder, near, onFloor, onSphere, placeOrder, words } from "../../../src/getup_jax/editor/page/steer_goals.js";

const location = { orders: { place: 2, within_s: 1 }, speed: [1, 1.3], slack: 1.3, radius_m: 0.5 };
const heading = { orders: { yaw_deg: 1, speed: 1 }, speed: [1.2, 1.5] };
const aiming = { orders: { yaw_deg: 1, pitch_deg: 1 } };

test("a policy's goals say what takes a place and what a direction", () => {
  assert.deepEqual(floorGoal({ aiming, target_location: location }), ["target_location", "place"]);
  assert.deepEqual(floorGoal({ tennis_swing: { orders: { land: 2 } } }), ["tennis_swing", "land"]);
  assert.equal(floorGoal({ aiming, target_heading: heading }), null);
  assert.deepEqual(directions({ target_location: location, target_heading: heading, aiming }), ["target_heading", "aiming"]);
});

test("a place is asked for at the trained speed, and never too far away", () => {
  assert.deepEqual(placeOrder([1, 0], [4, 4], location), { place: [4, 4], within_s: 5.652 });
  assert.equal(placeOrder([0, 0], [0.1, 0], location).within_s, 1);
  close(near([1, 1], [2, 3]), [2, 3]);
  close(near([1, 1], [1, 1e9]), [1, 31]);
  close(near([1, 1], [1, 1]), [1, 1]);
});

test("a heading is the way to the pointer, as fast as that is far, within what was trained", () => {
  assert.deepEqual(headingOrder([1, 1], [1, 9], heading), { yaw_deg: 90, speed: 1.5 });
  assert.deepEqual(headingOrder([0, 0], [-0.1, 0], heading), { yaw_deg: 180, speed: 1.2 });
});

test("an aim is a direction in space", () => {
  assert.deepEqual(aimOrder([0, -2, 0]), { yaw_deg: -90, pitch_deg: 0 });
  assert.deepEqual(aimOrder([1, 0, 1]), { yaw_deg: 0, pitch_deg: 45 });
});

test("a ray meets the floor, but not the sky, and a sphere, or comes near it", () => {
  close(/** @type {number[]} */ (onFloor([0, 0, 2], [0.6, 0, -0.8])), [1.5, 0]);
  assert.equal(onFloor([0, 0, 2], [1, 0, 0]), null);
  assert.equal(onFloor([0, 0, 2], [0.8, 0, 0.6]), null);
  close(onSphere([5, 0, 1], [-1, 0, 0], [0, 0, 1], 1), [1, 0, 0]);
  close(onSphere([5, 0, 4], [-1, 0, 0], [0, 0, 1], 1), [0, 0, 3]);
});

test("words say how far it is, and when it was there", () => {
  assert.equal(words(null, [0, 0]), "not told yet: targets of its own");
  assert.equal(words({ order: { place: [3, 4], within_s: 2 }, reached_after_s: null }, [0, 0]), "5.0 m away");
  assert.equal(words({ order: { place: [3, 4], within_s: 2 }, reached_after_s: 2.34 }, [0, 0]), "reached after 2.3 s");
  assert.equal(words({ order: { yaw_deg: 90, speed: null }, reached_after_s: null }, [0, 0]), "90°");
  assert.equal(words({ order: { yaw_deg: -30, pitch_deg: 10 }, reached_after_s: null }, [0, 0]), "-30°, 10° up");
});

test("a frame is shown for a control step each, and what comes late is not caught up with", () => {
  const buffer = new Buffer(0.1);
  const add = (/** @type {number[]} */ ...numbers) => numbers.forEach((number) => buffer.add({ number, payload: new ArrayBuffer(0) }));
  assert.equal(buffer.advance(5), null); // nothing has come
  add(1, 2, 3, 4, 5);
  assert.equal(buffer.advance(0)?.number, 1); // at once
  assert.equal(buffer.advance(0.05), null);
  assert.equal(buffer.advance(0.06)?.number, 2);
  assert.equal(buffer.advance(0.2)?.number, 4);
  assert.equal(buffer.advance(3)?.number, 5);
  add(6, 7);
  assert.equal(buffer.advance(0)?.number, 6);
  assert.equal(buffer.advance(0), null);
});

test("the pace is that of the last second", () => {
  const buffer = new Buffer(0.25);
  for (let number = 1; number <= 2; number++) buffer.add({ number, payload: new ArrayBuffer(0) });
  for (let i = 0; i < 4; i++) buffer.advance(0.25);
  assert.equal(buffer.pace, 0.5);
});
