import assert from "node:assert/strict";
import { test } from "node:test";

import { close, content, curve } from "./samples.js";
import { alike, distance } from "../../../src/getup_jax/editor/page/alike.js";
import { asked, duration, keptDuration, keptName, keysIn } from "../../../src/getup_jax/editor/page/content.js";
import * as edits from "../../../src/getup_jax/editor/page/edits.js";
import { drawn, valueAt } from "../../../src/getup_jax/editor/page/keys.js";
import { FEATURES, sample } from "../../../src/getup_jax/editor/page/spline.js";
import { startGap } from "../../../src/getup_jax/editor/page/starts.js";

const height = (now, seconds) => valueAt(keysIn(now, "height"), seconds / duration(now));
const FIRST = { starts: [{ name: "prone", first: [0.1, 80, 170] }], mirrored: "mirrored " };

test("a hold keeps all curves for its time and moves what follows", () => {
  const now = content(), held = edits.hold(now, 0.5, 1.5);
  assert.equal(duration(held), 5.5);
  for (const t of [2, 2.75, 3.5]) assert.ok(Math.abs(height(held, t) - height(now, 2)) < 2e-3);
  for (const t of [0.5, 1]) assert.ok(Math.abs(height(held, t) - height(now, t)) < 0.03);
  for (const t of [3.2, 3.8]) assert.ok(Math.abs(height(held, t + 1.5) - height(now, t)) < 0.03);
});

test("a hold past the longest duration is as long as there is room", () => {
  const held = edits.hold(content({ durations: [19.5] }), 0.5, 3);
  assert.equal(duration(held), 20);
});

test("a stretched part takes longer and what is outside keeps its speed", () => {
  const now = content(), slow = edits.stretch(now, 0.25, 0.5, 3);
  assert.equal(duration(slow), 6);
  assert.ok(Math.abs(height(slow, 4) - height(now, 2)) < 2e-3);
  assert.ok(Math.abs(height(slow, 2.5) - height(now, 1.5)) < 0.02);
  assert.ok(Math.abs(height(slow, 5.5) - height(now, 3.5)) < 0.02);
});

test("a wished pose is there from one time to another, in the curves that it is about", () => {
  const now = content(), on = edits.wish(now, 0.5, 0.75, { height: 0.5, front_angle: 165 });
  for (const t of [2, 2.5, 3]) assert.ok(Math.abs(height(on, t) - 0.5) < 1e-3);
  assert.deepEqual(on.curve.side_angle, now.curve.side_angle);
  const once = edits.wish(now, 0.5, 0.5, { height: 0.5 });
  assert.ok(Math.abs(height(once, 2) - 0.5) < 1e-3);
});

test("a wish is remembered with what it is about, moves with the time, and gives way to another", () => {
  const pose = { name: "kneels", contacts: ["left knee"] }, on = edits.wish(content(), 0.5, 0.75, { height: 0.5 }, pose);
  assert.deepEqual(on.wishes, [{ ...pose, from: 0.5, to: 0.75 }]);
  assert.deepEqual(edits.hold(on, 0.25, 4).wishes.map((w) => [w.from, w.to]), [[0.75, 0.875]]);
  assert.deepEqual(edits.wish(on, 0.6, 0.9, { height: 1 }).wishes, []);
  assert.deepEqual(edits.reset(on).wishes, []);
});

test("a wish at either end keeps the curve whole", () => {
  for (const [from, to] of [[0, 0], [1, 1], [0, 1], [0, 0.3], [0.7, 1]]) {
    const keys = keysIn(edits.wish(content(), from, to, { height: 0.6 }), "height");
    assert.deepEqual([keys[0].time, keys.at(-1).time], [0, 1]);
    assert.ok(keys.every((key, i) => !i || key.time > keys[i - 1].time));
    assert.ok(drawn(keys).every(Number.isFinite));
  }
});

test("a new key lies on the curve unless it is put elsewhere, and never on another key", () => {
  const now = content(), on = edits.add(now, "height", 0.3);
  assert.equal(keysIn(on, "height").length, 10);
  assert.ok(Math.abs(valueAt(keysIn(on, "height"), 0.3) - valueAt(keysIn(now, "height"), 0.3)) < 1e-3);
  assert.equal(edits.add(now, "height", 0.5), now);
  assert.equal(edits.add(now, "height", 1.2), now);
});

test("earlier and later move time and keep both ends", () => {
  const now = content(), later = edits.shift(now, 0.5);
  assert.ok(height(later, 2) < height(now, 2));
  close([height(later, 0), height(later, 4)], [0.11, 1.452], 1e-3);
  assert.equal(edits.shift(now, 0), now);
});

test("mirrored twice is where one began, with keys, starts and poses", () => {
  const mirror = { joint: [1, 0], sign: [-1, -1] }, pose = [1, 2, 3, 1, 0, 0, 0, 0.5, 0.25];
  for (const begin of [content(), edits.add(content(), "side_angle", 0.3), content({ pose })]) {
    const twice = edits.mirror(edits.mirror(begin, "mirrored ", mirror), "mirrored ", mirror);
    assert.deepEqual(twice, begin);
  }
  assert.equal(edits.mirror(content(), "mirrored ", mirror).curve.start, "mirrored prone");
});

test("another start moves the first key alone, and how far is known before", () => {
  const now = content(), first = edits.firstOf(FIRST, "mirrored prone");
  assert.deepEqual(first, [0.1, 100, 170]);
  assert.equal(startGap(now, first), 10);
  const from = edits.startFrom(now, "mirrored prone", first);
  assert.equal(startGap(from, first), 0);
  close(FEATURES.map((f) => keysIn(from, f).at(-1).value), [1.452, 90, 90], 1e-3);
});

test("what is drawn is what the policy is asked for, to a millimetre, where nine points can", () => {
  const now = edits.shift(content(), 0.2);
  const far = drawn(keysIn(now, "height")).map((v, i) => Math.abs(v - sample(now.curve.height)[i]));
  assert.ok(Math.max(...far) < 0.02);
});

test("no edit changes what it was given", () => {
  const now = content(), before = JSON.stringify(now);
  edits.hold(now, 0.4, 1);
  edits.stretch(now, 0.1, 0.9, 2);
  edits.wish(now, 0.2, 0.4, { height: 1 });
  edits.mirror(now, "mirrored ", { joint: [], sign: [] });
  edits.startFrom(now, "x", [0, 90, 90]);
  edits.reset(now);
  assert.equal(JSON.stringify(now), before);
});

test("an imported curve is compared with the styles that the policy knows, on either side", () => {
  const known = [curve({ name: "flat", height: Array(9).fill(0.1) }), curve({ name: "rise" })];
  const other = curve({ side_angle: curve().side_angle.map((v) => 180 - v) });
  assert.equal(alike(curve(), known), "like rise");
  assert.equal(alike(other, known), "like rise");
  assert.equal(alike(curve({ front_angle: Array(9).fill(0) }), known), "unlike any style that the policy knows");
  assert.equal(distance(curve(), curve()), 0);
});

test("fields keep what can be kept", () => {
  assert.deepEqual([100, -3, NaN, 3.456].map(keptDuration), [20, 0.5, 0.5, 3.46]);
  assert.equal(keptName("Tom's rise, late/low 2 ä_-.@:~"), "Toms rise latelow 2 ä_-.@:~");
  assert.equal(keptName("हिन्दी"), "हिन्दी"); // vowel signs are marks, no letters
});

test("a request has no names: they change no motion", () => {
  assert.deepEqual(asked(content({ name: "a" })), asked(content({ name: "b, c/d", strategy: "x" })));
  assert.deepEqual(Object.keys(asked(content()).curve).sort(), ["durations", "front_angle", "height", "side_angle", "start"]);
});
