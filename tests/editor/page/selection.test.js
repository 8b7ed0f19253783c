import assert from "node:assert/strict";
import { test } from "node:test";

import { close, content } from "./samples.js";
import { keysIn } from "../../../src/getup_jax/editor/page/content.js";
import { GAP } from "../../../src/getup_jax/editor/page/keys.js";
import * as selection from "../../../src/getup_jax/editor/page/selection.js";

const times = (now, feature = "height") => keysIn(now, feature).map((key) => key.time);
const values = (now, feature = "height") => keysIn(now, feature).map((key) => key.value);

test("keys move in time and value, and only the selected ones", () => {
  const now = content(), moved = selection.move(now, { height: [3, 4] }, 0.05, { height: 0.1 });
  close([3, 4].map((i) => times(moved)[i]), [0.425, 0.55]);
  assert.ok(Math.abs(values(moved)[3] - values(now)[3] - 0.1) < 1e-3);
  close(times(moved).toSpliced(3, 2), times(now).toSpliced(3, 2));
  assert.equal(moved.curve.side_angle, now.curve.side_angle);
});

test("no key passes another, however far it is dragged, and the ends keep their time", () => {
  for (const by of [-5, -0.3, 0.3, 5]) {
    for (const picked of [[4], [3, 4, 5], [0, 4], [4, 8], [0, 1, 2, 3, 4, 5, 6, 7, 8]]) {
      const found = times(selection.move(content(), { height: picked }, by, {}));
      assert.deepEqual([found[0], found[8]], [0, 1]);
      for (let i = 1; i < 9; i++) assert.ok(found[i] - found[i - 1] >= GAP - 1e-9, `${picked} by ${by}: ${found}`);
    }
  }
});

test("values stay within what a body can do", () => {
  const up = selection.move(content(), { height: [4], side_angle: [4] }, 0, { height: 9, side_angle: -999 });
  assert.equal(values(up)[4], 1.7);
  assert.equal(values(up, "side_angle")[4], 0);
});

test("scaling times and values keeps what it is about", () => {
  const now = content(), wide = selection.scale(now, { height: [3, 4, 5] }, { time: 0.375, factor: 1.4 });
  close(times(wide).slice(3, 6), [0.375, 0.55, 0.725]);
  const low = Math.min(...values(now).slice(3, 6));
  const flat = selection.scale(now, { height: [3, 4, 5] }, { values: { height: { about: low, factor: 0 } } });
  close(values(flat).slice(3, 6), [low, low, low], 1e-3);
});

test("deleted keys are gone, but for the ends; kinds and numbers are set for all", () => {
  const now = content();
  assert.equal(times(selection.remove(now, { height: [0, 3, 4, 8] })).length, 7);
  const flat = selection.passing(now, { height: [2], front_angle: [3] }, "flat");
  assert.deepEqual([keysIn(flat, "height")[2].kind, keysIn(flat, "front_angle")[3].kind, keysIn(flat, "height")[3].kind], ["flat", "flat", "auto"]);
  const typed = selection.place(now, { height: [4] }, { time: 0.55, value: 0.8 });
  assert.deepEqual([times(typed)[4], values(typed)[4]], [0.55, 0.8]);
  const several = selection.place(now, { height: [4, 5], front_angle: [3] }, { time: 0.45 });
  close([...times(several).slice(4, 6), times(several, "front_angle")[3]], [0.45, 0.575, 0.45]);
});

test("what is copied is pasted at another time, and into a curve of another duration", () => {
  const clip = selection.copy(content(), { height: [3, 4], front_angle: [4] });
  assert.equal(clip.height[1].time, 0.5);
  const other = content({ durations: [8] }), pasted = selection.paste(other, clip, 0.7);
  close(times(pasted).slice(6, 8), [0.7, 0.7625]);
  close(values(pasted).slice(6, 8), clip.height.map((key) => key.value), 1e-3);
  assert.ok(times(pasted, "front_angle").some((t) => Math.abs(t - 0.7625) < 1e-9));
  assert.equal(pasted.curve.side_angle, other.curve.side_angle);
  assert.deepEqual(selection.pasted(pasted, clip, 0.7), { height: [6, 7], side_angle: [], front_angle: [7] });
  const late = selection.paste(other, clip, 0.99);
  assert.ok(times(late).every((t) => t <= 1));
});

test("what is copied from one angle goes to the curve whose keys are selected", () => {
  const clip = selection.copy(content(), { front_angle: [3, 4] });
  assert.deepEqual(selection.onto(clip, { side_angle: [2] }), { side_angle: clip.front_angle });
  for (const picked of [{}, { front_angle: [3] }, { height: [3] }, { side_angle: [2], front_angle: [3] }]) assert.deepEqual(selection.onto(clip, picked), clip);
});

test("a box selects the keys in it, and a selection forgets keys that are gone", () => {
  const now = content();
  assert.deepEqual(selection.inside(keysIn(now, "height"), [0.3, 0], [0.7, 2]), [3, 4, 5]);
  assert.deepEqual(selection.inside(keysIn(now, "height"), [0.7, 2], [0.3, 0]), [3, 4, 5]);
  const other = selection.remove(now, { height: [1] }), before = selection.lengths(now), picked = { height: [2], side_angle: [3] };
  assert.deepEqual(selection.valid(now, picked, before), { ...picked, front_angle: [] });
  // another key is the second one now
  assert.deepEqual(selection.valid(other, picked, before), { height: [], side_angle: [3], front_angle: [] });
  assert.equal(selection.count({ height: [1, 2], side_angle: [3] }), 3);
  assert.deepEqual(selection.toggled({ height: [1] }, "height", 1).height, []);
});
