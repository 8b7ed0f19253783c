import assert from "node:assert/strict";
import { test } from "node:test";

import { curve, store, Wire } from "./samples.js";
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

test("an import that was mirrored, pose and all, has no motion behind it", () => {
  const made = store(), sources = new Sources(/** @type {any} */ (new Wire()), made), one = take("a.bvh", 1.3);
  one.curve.pose = [0, 0.1, 0.2, 1, 0, 0, 0, 0.5];
  made.addImported([one]);
  made.commit((now) => choose(now, one.curve));
  assert.equal(sources.any, true);
  made.commit((now) => mirror(now, "mirrored ", { joint: [0], sign: [-1] }));
  assert.equal(sources.any, false);
});

test("a curve that was drawn, or starts elsewhere, has no motion behind it", () => {
  const made = store(), sources = new Sources(/** @type {any} */ (new Wire()), made);
  assert.equal(sources.any, false);
  sources.library = new Set(["rise"]);
  assert.equal(sources.any, true);
  made.commit((now) => startFrom(now, "supine", [0.1, 90, 0]));
  assert.equal(sources.any, false);
});
