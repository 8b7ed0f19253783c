import assert from "node:assert/strict";
import { test } from "node:test";

import { close, curve, store, Wire } from "./samples.js";
import { choose, mirror, startFrom } from "../../../src/getup_jax/editor/page/edits.js";
import { Sources } from "../../../src/getup_jax/editor/page/sources.js";

const take = (file, end) => ({ curve: curve({ name: "take", height: [...Array(8).fill(0.3), end] }), file, recording: { fps: 30, total: 0, links: 0, frames: new Float32Array() } });

test("each of two imports with one name has its own motion behind it", () => {
  const made = store(), sources = new Sources(/** @type {any} */ (new Wire()), made), imported = [take("one/a.bvh", 1.3), take("two/a.bvh", 1.4)];
  made.addImported(imported);
  for (const { curve: own, recording } of imported) {
    made.commit((now) => choose(now, own));
    assert.equal(sources.recording, recording);
  }
});

test("an import that was mirrored, pose and all, has the mirror image behind it", () => {
  const made = store(), sources = new Sources(/** @type {any} */ (new Wire()), made), one = take("a.bvh", 1.3);
  one.curve.pose = [0, 0.1, 0.2, 1, 0, 0, 0, 0.5, -0.2];
  one.recording = { fps: 30, total: 1, links: 2, frames: Float32Array.from([1, 2, 3, 0.1, 0.2, 0.3, 0.4, 4, 5, 6, 0.5, 0.6, 0.7, 0.8, 0.9, 70, 100]) };
  sources.mirror = { joint: [1, 0], sign: [-1, -1], link: [1, 0], word: "mirrored " };
  made.addImported([one]);
  made.commit((now) => choose(now, one.curve));
  assert.equal(sources.side, "itself");
  const swap = () => made.commit((now) => mirror(now, "mirrored ", sources.mirror));
  swap();
  assert.equal(sources.side, "mirrored");
  close([...sources.recording.frames], [4, -5, 6, 0.5, -0.6, 0.7, -0.8, 1, -2, 3, 0.1, -0.2, 0.3, -0.4, 0.9, 110, 100], 1e-6);
  assert.equal(sources.recording, sources.recording, "it is made once");
  swap();
  assert.deepEqual([sources.side, sources.recording], ["itself", one.recording]);
});

test("a mirrored start of the library has the mirror image behind it, also where a file says so", () => {
  const made = store(), sources = new Sources(/** @type {any} */ (new Wire()), made);
  sources.library = new Set(["rise"]);
  sources.mirror = { joint: [], sign: [], link: [], word: "mirrored " };
  assert.equal(sources.side, "itself");
  made.commit((now) => mirror(now, "mirrored ", sources.mirror));
  assert.equal(sources.side, "mirrored");
  made.commit((now) => choose(now, curve({ start: "mirrored prone" })));
  assert.equal(sources.side, "mirrored");
});

test("a curve that was drawn, or starts elsewhere, has no motion behind it", () => {
  const made = store(), sources = new Sources(/** @type {any} */ (new Wire()), made);
  assert.equal(sources.any, false);
  sources.library = new Set(["rise"]);
  assert.equal(sources.any, true);
  made.commit((now) => startFrom(now, "supine", [0.1, 90, 0]));
  assert.equal(sources.any, false);
});
