// All keys, wherever the focus is, but for what is being typed; and the list of them.

import { $, chooses, el, types } from "./dom.js";

/** @typedef {{ keys: string, words: string, press: string[], act: () => void }} Shortcut press: as `named` gives them */

/** A key with what is held beside it, as in a list of shortcuts. @param {KeyboardEvent} event */
export function named(event) {
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  return `${event.ctrlKey || event.metaKey ? "Ctrl+" : ""}${event.altKey ? "Alt+" : ""}${event.shiftKey && key.length > 1 ? "Shift+" : ""}${event.shiftKey && (event.ctrlKey || event.metaKey) && key.length === 1 ? "Shift+" : ""}${key}`;
}

/** @param {Shortcut[]} shortcuts */
export function listen(shortcuts) {
  const table = new Map(shortcuts.flatMap(({ press, act }) => press.map((key) => [key, act])));
  addEventListener("keydown", (event) => {
    const name = named(event), act = table.get(name);
    if (!act || event.defaultPrevented || $("dialog").open) return;
    if ((types(event.target) && name !== "Ctrl+s") || chooses(event.target, name)) return;
    // a button that was reached by Tab is pressed by the space bar
    const target = /** @type {Element} */ (event.target);
    if (name === " " && target.matches("button:focus-visible, input[type=checkbox]:focus-visible")) return;
    event.preventDefault();
    act();
  });
  // a field that is done with gives the keys back
  addEventListener("keydown", (event) => {
    if (event.key === "Enter" && types(event.target) && !$("dialog").open) /** @type {HTMLElement} */ (event.target).blur();
  });
  // what was clicked does not keep the keys that follow
  addEventListener("pointerup", (event) => {
    const target = /** @type {Element} */ (event.target).closest?.("button, input[type=range], input[type=checkbox]");
    if (target && !$("dialog").open) /** @type {HTMLElement} */ (target).blur();
  });
  addEventListener("change", (event) => {
    const target = /** @type {HTMLElement} */ (event.target);
    if (target.matches("select:not(:focus-visible)") && !$("dialog").open) target.blur();
  });
}

const MOUSE = [
  ["drag a point", "time and value; it snaps to frames and round values, Ctrl for the other way"], ["double click", "a new point"], ["drag over nothing", "select with a box; Shift adds"],
  ["the frame of several points", "drag a side to scale time or value"], ["click, or drag the axis below", "go to a time"], ["wheel, two fingers", "zoom time; Shift: move; Alt: zoom values"],
  ["Alt and drag", "move along the time"], ["arrows on a point", "up and down: value (Shift: five times); left and right: next point; Alt: a frame"], ["in the view", "drag to orbit, wheel or two fingers to zoom"],
];

/** @param {Shortcut[]} shortcuts */
export function help(shortcuts) {
  const dialog = $("dialog");
  const rows = [...shortcuts.filter(({ keys }) => keys).map(({ keys, words }) => [keys, words]), ...MOUSE];
  dialog.replaceChildren(
    el("h2", { id: "dialog-title" }, "Keys and mouse"),
    el("dl", { id: "help-list" }, ...rows.flatMap(([keys, words]) => [el("dt", {}, keys), el("dd", {}, words)])),
    el("p", { class: "buttons" }, el("button", { onclick: () => dialog.close() }, "Close")),
  );
  dialog.showModal();
}
