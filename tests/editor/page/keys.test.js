import assert from "node:assert/strict";
import { test } from "node:test";

import { content, close } from "./samples.js";
import { misfit, withKeys } from "../../../src/getup_jax/editor/page/content.js";
import { drawn, fit, keysOf, valueAt, valuesAt } from "../../../src/getup_jax/editor/page/keys.js";
import { sample } from "../../../src/getup_jax/editor/page/spline.js";

const POINTS = [0.11, 0.17, 0.4, 0.53, 0.55, 0.66, 0.92, 1.2, 1.452];
const key = (time, value, kind = "auto") => ({ time, value, kind });

test("nine keys of control points are exactly their curve, and are fitted by them again", () => {
  const keys = keysOf(POINTS);
  close(drawn(keys), sample(POINTS));
  close(fit(keys), POINTS);
});

test("every key lies on the drawn curve, of whatever kind", () => {
  const keys = [key(0, 0), key(0.1, 1, "linear"), key(0.3, 0.2), key(0.35, 0.9, "flat"), key(0.8, 0.4), key(1, 1)];
  close(valuesAt(keys, keys.map((k) => k.time)), keys.map((k) => k.value));
});

test("a flat key is level, two of one value hold it, and a linear pair is a straight line", () => {
  const slope = (keys, t) => (valueAt(keys, t + 1e-5) - valueAt(keys, t - 1e-5)) / 2e-5;
  const keys = [key(0, 0), key(0.4, 0.5, "flat"), key(0.6, 0.5, "flat"), key(1, 1)];
  assert.ok(Math.abs(slope(keys, 0.4)) < 1e-3);
  close(valuesAt(keys, [0.45, 0.5, 0.55]), [0.5, 0.5, 0.5]);
  const line = [key(0, 0), key(0.2, 0.3, "linear"), key(0.7, 0.8, "linear"), key(1, 0)];
  close(valuesAt(line, [0.3, 0.45, 0.6]), [0.4, 0.55, 0.7]);
});

test("the drawn curve bends evenly at an auto key: slope and curvature do not jump", () => {
  const keys = [key(0, 0), key(0.3, 1), key(0.5, 0.2), key(1, 0.7)], h = 1e-4;
  for (const t of [0.3, 0.5]) {
    const [a, b, c, d, e] = valuesAt(keys, [t - 2 * h, t - h, t, t + h, t + 2 * h]);
    assert.ok(Math.abs((a - 2 * b + c) / h ** 2 - (c - 2 * d + e) / h ** 2) < 0.5);
  }
});

test("the fit keeps both ends and is the nearest: no control point can be moved for the better", () => {
  const keys = [key(0, 0.1), key(0.42, 0.5, "flat"), key(0.58, 0.5, "flat"), key(1, 1.4)];
  const found = fit(keys), wanted = drawn(keys);
  const cost = (points) => sample(points).reduce((sum, v, i) => sum + (v - wanted[i]) ** 2, 0);
  assert.deepEqual([found[0], found[8]], [0.1, 1.4]);
  for (let i = 1; i < 8; i++) {
    for (const by of [-0.005, 0.005]) assert.ok(cost(found) < cost(found.map((p, j) => (j === i ? p + by : p))));
  }
});

test("a curve that nine points cannot follow says how far off they are", () => {
  const now = content();
  assert.equal(misfit(now, "height"), 0);
  const steep = [key(0, 0.1), key(0.49, 0.1, "linear"), key(0.51, 1.4, "linear"), key(1, 1.4)];
  assert.ok(misfit(withKeys(now, { height: steep }), "height") > 0.2);
});
