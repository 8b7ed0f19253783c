import assert from "node:assert/strict";
import { test } from "node:test";

import { recalled, remember } from "../../../src/getup_jax/editor/page/recall.js";

test("what is remembered is recalled, and a browser that forbids it is one that forgets", () => {
  const kept = new Map();
  Object.defineProperty(globalThis, "localStorage", { configurable: true, get: () => ({ getItem: (key) => kept.get(key) ?? null, setItem: (key, text) => kept.set(key, text) }) });
  Object.defineProperty(globalThis, "sessionStorage", { configurable: true, get() { throw new Error("denied"); } });
  for (const where of ["localStorage", "sessionStorage"]) remember(where, "a", "b");
  assert.deepEqual([recalled("localStorage", "a"), recalled("localStorage", "c"), recalled("sessionStorage", "a")], ["b", null, null]);
});
