import assert from "node:assert/strict";
import { test } from "node:test";

import { refusals } from "../../../src/getup_jax/editor/page/files.js";

test("one line says why files were refused, however many", () => {
  assert.equal(refusals(["a: bad"]), "a: bad");
  assert.equal(refusals(["a", "b"]), "2 files were refused. a · b");
  assert.equal(refusals([..."abcde"]), "5 files were refused. a · b · c · and 2 more");
});
