import assert from "node:assert/strict";
import { test } from "node:test";

import { curve, store } from "./samples.js";
import { Judging } from "../../../src/getup_jax/editor/page/judging.js";

/** A link whose answers are made by a function; what it throws is an error's text. */
function link(answer) {
  const asked = [];
  return { asked, open: true, async ask(request) {
    asked.push(request);
    return answer.call(this, request);
  } };
}
const imported = (...curves) => curves.map((one) => ({ curve: one, file: "walk.bvh", recording: null }));

test("every imported curve is judged once, whatever it is called", async () => {
  const s = store(), wire = link(({ curve: { durations: [seconds] } }) => ({ success: seconds > 3, stands: seconds > 1, verdict: `after ${seconds} s` }));
  const judging = new Judging(wire, s);
  s.addImported(imported(curve({ durations: [4] }), curve({ durations: [2] }), curve({ name: "again", durations: [4] }), curve({ durations: [1] })));
  let told = 0;
  judging.addEventListener("change", () => { told += 1; });
  await judging.update();
  await judging.update();
  assert.deepEqual([wire.asked.length, told], [3, 3]);
  assert.equal(judging.of(curve({ durations: [4] })), "✓ after 4 s");
  assert.equal(judging.of(curve({ durations: [2] })), "≈ after 2 s", "it stands, but not as it was asked to");
  assert.equal(judging.of(curve({ durations: [1] })), "✗ after 1 s");
  assert.equal(judging.of(curve({ durations: [5] })), "");
});

test("a refusal is an answer; a lost connection is none, and it is asked for again", async () => {
  const s = store();
  const wire = link(function () {
    if (wire.asked.length === 1) throw new Error("curve: start: nothing lies so");
    this.open = wire.asked.length > 2;
    if (!this.open) throw new Error("the connection was lost");
    return { success: true, verdict: "stands" };
  });
  const judging = new Judging(wire, s);
  s.addImported(imported(curve({ durations: [1] }), curve({ durations: [2] })));
  await judging.update();
  assert.equal(judging.of(curve({ durations: [1] })), "✗ curve: start: nothing lies so");
  assert.equal(judging.of(curve({ durations: [2] })), "");
  wire.open = true;
  await judging.update();
  assert.equal(judging.of(curve({ durations: [2] })), "✓ stands");
});

test("another server may have another policy: what the last one said is asked for again", async () => {
  const s = store(), answers = [];
  const wire = link(() => new Promise((resolve) => answers.push(resolve)));
  const judging = new Judging(wire, s), end = () => new Promise((resolve) => setTimeout(resolve));
  s.addImported(imported(curve({ durations: [1] })));
  judging.update();
  answers[0]({ success: true, verdict: "by the first" });
  await end();
  assert.equal(judging.of(curve({ durations: [1] })), "✓ by the first");
  judging.begin();
  assert.equal(judging.of(curve({ durations: [1] })), "");
  judging.update();
  judging.begin(); // the second one is gone before its answer is read
  answers[1]({ success: true, verdict: "by the second" });
  await end();
  answers[2]({ success: false, verdict: "by the third" });
  await end();
  assert.equal(judging.of(curve({ durations: [1] })), "✗ by the third");
});
