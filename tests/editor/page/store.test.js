import assert from "node:assert/strict";
import { test } from "node:test";

import { store } from "./samples.js";
import * as edits from "../../../src/getup_jax/editor/page/edits.js";

const last = (seconds) => (now) => edits.last(now, seconds);
const seconds = (s) => s.now.curve.durations[0];

test("undo and redo bring contents back, and a new edit forgets the undone ones", () => {
  const s = store();
  s.commit(last(5));
  s.commit(last(6));
  s.undo();
  assert.equal(seconds(s), 5);
  s.undo();
  s.undo();
  assert.equal(seconds(s), 4);
  s.redo();
  assert.equal(seconds(s), 5);
  s.commit(last(7));
  s.redo();
  assert.equal(seconds(s), 7);
});

test("undo is of the variant that is shown: it changes no other and never goes to another", () => {
  const s = store();
  s.commit(last(5));
  s.addVariant();
  s.commit(last(9));
  s.show(0);
  s.undo();
  assert.deepEqual([s.active, seconds(s)], [0, 4]);
  s.show(1);
  assert.equal(seconds(s), 9);
  s.undo();
  assert.deepEqual([s.active, seconds(s)], [1, 5]);
  s.undo();
  assert.deepEqual([s.active, seconds(s)], [1, 5], "a variant begins where it was copied");
});

test("a gesture is one step from where it began; taken back it leaves none", () => {
  const s = store();
  for (const t of [5, 6, 7]) s.live(last(t));
  s.commit();
  s.undo();
  assert.equal(seconds(s), 4);
  s.live(last(9));
  assert.ok(s.cancel());
  assert.equal(seconds(s), 4);
  assert.equal(s.current.history.past.length, 0);
  assert.ok(!s.cancel());
});

test("undo while a gesture goes on takes back the gesture alone", () => {
  const s = store();
  s.commit(last(5));
  s.live(last(9));
  s.undo();
  assert.equal(seconds(s), 5);
});

test("presses of a key that follow each other are one step, other edits and later ones are not", () => {
  const s = store();
  for (let i = 0; i < 5; i++) s.commit((now) => edits.last(now, now.curve.durations[0] + 0.1), { tag: "up", at: 100 * i });
  s.commit(last(8), { tag: "down", at: 500 });
  s.commit(last(9), { tag: "down", at: 5000 });
  assert.equal(s.current.history.past.length, 3);
  s.undo();
  s.undo();
  s.undo();
  assert.equal(seconds(s), 4);
});

test("what changes nothing is no step", () => {
  const s = store();
  s.commit(last(4));
  s.commit();
  assert.equal(s.current.history.past.length, 0);
});

test("a removed variant can be put back with its undo, letters stay, and four is the most", () => {
  const s = store();
  s.addVariant();
  s.commit(last(9));
  s.addVariant();
  s.show(1);
  const removed = s.removeActive();
  assert.deepEqual(s.variants.map((v) => v.slot), [0, 2]);
  s.putBack(removed);
  assert.deepEqual([s.active, seconds(s)], [1, 9]);
  s.undo();
  assert.equal(seconds(s), 4);
  s.addVariant();
  s.addVariant();
  assert.equal(s.variants.length, 4);
});

test("undo right after a removal puts the variant back; after any edit it takes back the edit", () => {
  const s = store();
  s.addVariant();
  s.commit(last(9));
  s.removeActive();
  assert.ok(s.undoable);
  s.undo();
  assert.deepEqual([s.active, seconds(s), s.project.removed.length], [1, 9, 0]);
  s.removeActive();
  s.commit(last(6));
  s.undo();
  assert.deepEqual([s.variants.length, seconds(s), s.project.removed.length], [1, 4, 1]);
  s.undo();
  assert.equal(s.variants.length, 1, "what is older than the edits is in the list alone");
});

test("the last four removed variants are kept and come back with their undo, under another letter where theirs is taken", () => {
  const s = store();
  for (const t of [5, 6, 7, 8, 9]) {
    s.addVariant();
    s.commit(last(t));
    s.removeActive();
  }
  const { removed } = s.project;
  assert.deepEqual(removed.map((v) => v.history.now.curve.durations[0]), [6, 7, 8, 9]);
  s.addVariant(); // takes the letter that all of them had
  for (const one of removed.slice(0, 2)) assert.ok(s.putBack(one));
  assert.deepEqual([s.active, seconds(s), s.variants.map((v) => v.slot)], [3, 7, [0, 1, 2, 3]]);
  assert.equal(s.putBack(removed[2]), false, "four are the most");
  s.undo();
  assert.equal(seconds(s), 4);
  assert.deepEqual(s.project.removed, removed.slice(2));
});

test("files of several variants have the variant's letter, the one of a single variant has none", () => {
  const s = store();
  assert.equal(s.fileName("my.rise.yaml"), "my.rise.yaml");
  s.addVariant();
  assert.equal(s.fileName("my.rise.yaml"), "my.rise_B.yaml");
  s.show(0);
  assert.equal(s.fileName("my.rise.yaml"), "my.rise_A.yaml");
});

test("the span is that of the longest variant, so that no ghost is cut off", () => {
  const s = store();
  s.commit(last(9));
  s.addVariant();
  s.commit(last(3));
  assert.equal(s.longest, 9);
});
