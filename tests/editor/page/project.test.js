import assert from "node:assert/strict";
import { test } from "node:test";

import { curve, store } from "./samples.js";
import * as edits from "../../../src/getup_jax/editor/page/edits.js";
import { checked, fromText, MOST_IMPORTED, project, toText } from "../../../src/getup_jax/editor/page/project.js";

function full() {
  const s = store();
  s.commit((now) => edits.hold(now, 0.5, 1));
  s.commit((now) => ({ ...now, region: 2, place: 3 }));
  s.undo();
  s.addVariant();
  s.commit((now) => edits.add(now, "height", 0.33));
  s.addVariant();
  s.removeActive();
  s.addImported([{ curve: curve({ name: "walk:1-9" }), file: "walk.bvh", recording: { fps: 30, total: 2, links: 1, frames: Float32Array.from({ length: 20 }, (_, i) => i / 3) } }]);
  return s.project;
}
const contents = ({ variants, active, imported, name, removed }) => ({
  active, imported, name, variants: [...variants, ...removed].map(({ slot, history: { now, past, future } }) => ({ slot, now, past, future })),
});

test("a project comes back from its file with variants, undo, ground, imports and what was removed", () => {
  const before = full(), after = fromText(toText(before), "a.getup.json");
  assert.equal(after.removed.length, 1);
  assert.deepEqual(contents(after), contents(before));
  assert.notEqual(after.id, before.id, "an imported project is one of its own");
  assert.ok(after.imported[0].recording.frames instanceof Float32Array);
});

test("a file that is no project is refused in one line that names it", () => {
  const good = JSON.parse(toText(full()));
  const broken = [
    "", "{", "[]", "null", "{}", JSON.stringify({ ...good, format: 2 }), JSON.stringify({ ...good, variants: [] }),
    JSON.stringify({ ...good, variants: [good.variants[0], good.variants[0]] }), JSON.stringify({ ...good, name: 5 }), JSON.stringify({ ...good, imported: [{}] }),
  ];
  const spoilt = (/** @type {(c: any) => void} */ change) => {
    const copy = structuredClone(good);
    change(copy.variants[0].history.now);
    return JSON.stringify(copy);
  };
  broken.push(spoilt((c) => { c.curve.height = [1]; }), spoilt((c) => { c.curve.durations = ["x"]; }), spoilt((c) => { c.region = -1; }), spoilt((c) => { c.keys = { height: [{ time: 0.5, value: 1 }, { time: 0.2, value: 1 }] }; }));
  for (const text of broken) {
    assert.throws(() => fromText(text, "a.json"), (error) => error.message.startsWith("a.json: ") && !error.message.includes("\n"), text.slice(0, 80));
  }
});

test("every part is missed: a project without any key of it is refused or whole", () => {
  const good = JSON.parse(toText(project(curve(), "p")));
  for (const key of Object.keys(good)) {
    const { [key]: gone, ...rest } = good;
    try { checked(rest); } catch (error) { assert.match(error.message, /expected/); }
  }
});

test("names of files that are not allowed here are mended, not refused", () => {
  const odd = fromText(toText(project(curve({ name: "Tom's, a/b" }), "p")), "p");
  assert.equal(odd.variants[0].history.now.curve.name, "Toms ab");
});

test("whatever was imported can be read again: long names of files, and no more than there is room for", () => {
  const s = store(), one = { curve: curve(), file: `${"ä😀".repeat(90)}.bvh`, recording: null };
  assert.equal(s.addImported(Array(MOST_IMPORTED - 1).fill(one)), 0);
  assert.equal(s.addImported([one, one, one]), 2);
  assert.equal(checked(s.project).imported.length, MOST_IMPORTED);
});

test("whatever is pressed together can be read again", () => {
  const s = store();
  for (const [amount, seconds] of [[-1, 0.1], [1, 10]]) {
    for (let i = 0; i < 60; i++) s.commit((now) => edits.shift(now, amount));
    checked(s.project);
    for (let i = 0; i < 30; i++) s.commit((now) => edits.stretch(edits.hold(now, 0.5, seconds), 0.2, 0.3, 0.1));
    checked(s.project);
  }
});
