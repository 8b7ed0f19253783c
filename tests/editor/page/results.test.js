import assert from "node:assert/strict";
import { test } from "node:test";

import { store, Wire } from "./samples.js";
import * as edits from "../../../src/getup_jax/editor/page/edits.js";
import { verdictOf } from "../../../src/getup_jax/editor/page/report.js";
import { Results } from "../../../src/getup_jax/editor/page/results.js";

function page() {
  const s = store(), wire = new Wire(), results = new Results(wire, s);
  results.begin({ links: ["pelvis"] });
  s.addEventListener("change", ({ detail }) => results.update(detail.at));
  results.update(0);
  const verdict = () => verdictOf(results.active, results.current(s.active), wire.open), words = () => verdict().words;
  return { s, wire, results, verdict, words };
}
const last = (seconds) => (now) => edits.last(now, seconds);

test("a verdict is of the motion that is shown, and gone as soon as anything is edited", () => {
  const { s, wire, words } = page();
  assert.equal(words(), "Simulating …");
  wire.frames(0, 1);
  wire.result(0, 1);
  assert.equal(words(), "Stands after 2.0 s");
  s.commit(last(9));
  assert.equal(words(), "Simulating …");
  wire.result(0, 1, "old");
  assert.equal(words(), "Simulating …");
  wire.frames(0, 2);
  wire.result(0, 2, "fails at 1.0 s: head on the floor", false);
  assert.equal(words(), "Fails at 1.0 s: head on the floor");
});

test("a motion that stands, but too far from its curves, is neither good nor bad", () => {
  const { wire, verdict } = page(), moods = [];
  wire.frames(0, 1);
  for (const [success, stands] of [[true, true], [false, true], [false, false]]) {
    wire.result(0, 1, "so", success, stands);
    moods.push(verdict().mood);
  }
  assert.deepEqual(moods, ["good", "near", "bad"]);
});

test("a refused motion leaves no older one standing, and says why", () => {
  const { s, wire, results, words } = page();
  wire.frames(0, 1);
  wire.result(0, 1);
  s.commit(last(9));
  wire.says("error", { number: 2, text: "curve: start: expected one of a, b" });
  assert.equal(words(), "Not simulated: curve: start: expected one of a, b");
  assert.equal(results.active.motion, null);
  s.undo();
  assert.equal(wire.sent.length, 3, "it is asked for again");
});

test("undo across variants shows every variant with its own verdict", () => {
  const { s, wire, results, words } = page();
  wire.frames(0, 1);
  wire.result(0, 1, "a");
  s.addVariant();
  s.commit(last(9));
  for (const { slot, number } of wire.sent.slice(1)) {
    wire.frames(slot, number);
    wire.result(slot, number, `of ${number}`);
  }
  s.show(0);
  assert.equal(words(), "A");
  s.undo();
  assert.deepEqual([s.active, words()], [0, "A"]);
  s.show(1);
  s.undo();
  assert.deepEqual([s.active, words()], [1, "Simulating …"]);
  assert.equal(results.shown.get(0).verdict.verdict, "a");
});

test("names ask for nothing", () => {
  const { s, wire } = page();
  s.commit((now) => edits.withCurve(now, { name: "Tom's, other/name" }), { at: null });
  assert.equal(wire.sent.length, 1);
  assert.ok(!JSON.stringify(wire.sent).includes("Tom"));
});

test("while a gesture goes on there is one request at a time, and its end is asked for", () => {
  const { s, wire } = page();
  wire.frames(0, 1);
  for (const t of [5, 6, 7]) s.live(last(t));
  assert.equal(wire.sent.length, 2);
  wire.frames(0, 2);
  assert.equal(wire.sent.at(-1).curve.durations[0], 7);
  s.commit(null, { at: 100 });
  assert.equal(wire.sent.length, 4);
});

test("a variant that is gone, and another project, keep no motion", () => {
  const { s, wire, results } = page();
  s.addVariant();
  const { slot, number } = wire.sent.at(-1);
  s.removeActive();
  wire.frames(slot, number);
  assert.equal(results.shown.has(slot), false);
  wire.frames(0, 1);
  results.clear();
  assert.equal(results.active, undefined);
});

test("what cannot be asked for is said not to be simulated", () => {
  const { s, wire, words } = page();
  wire.frames(0, 1);
  wire.result(0, 1);
  wire.open = false;
  assert.equal(words(), "Stands after 2.0 s");
  s.commit(last(9));
  assert.equal(words(), "Not simulated: no connection");
});

test("a verdict of the last server is none of the next one, which may have another policy", () => {
  const { wire, results, s, words } = page();
  wire.frames(0, 1);
  wire.result(0, 1, "by the first");
  results.begin({ links: ["pelvis"] });
  assert.equal(words(), "Simulating …");
  s.tell("show");
  assert.equal(wire.sent.length, 2);
  wire.frames(0, 2);
  wire.result(0, 2, "by the second");
  assert.equal(words(), "By the second");
});
