import assert from "node:assert/strict";
import { test } from "node:test";

import { chooses, types } from "../../../src/getup_jax/editor/page/dom.js";

const list = (tabbed) => ({ tagName: "SELECT", matches: () => tabbed });

test("a list that has the focus keeps the keys that choose from it, and no others", () => {
  for (const key of ["f", "h", "0", "?", "Home", "Shift+ArrowLeft"]) assert.ok(chooses(list(true), key), key);
  for (const key of ["Ctrl+z", "Escape", "Delete"]) assert.ok(!chooses(list(true), key), key);
  assert.deepEqual([chooses(list(true), " "), chooses(list(false), " ")], [true, false]);
  assert.ok(!chooses({ tagName: "BUTTON" }, "f"));
});

test("a field that is typed into keeps all keys; a slider and a box to tick have none to type", () => {
  for (const type of ["text", "number", "search"]) assert.ok(types({ tagName: "INPUT", type }), type);
  for (const type of ["range", "checkbox"]) assert.ok(!types({ tagName: "INPUT", type }), type);
  assert.ok(!types(null));
});
