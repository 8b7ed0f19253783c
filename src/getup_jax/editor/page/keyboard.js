// What every key does.

import { $ } from "./dom.js";

/**
 * @param {{ store: import("./store.js").Store, player: import("./player.js").Player, tools: import("./tools.js").Tools, graph: import("./graph.js").Graph,
 *   files: import("./files.js").Files, stage: import("./stage.js").Stage, help: () => void }} page
 * @returns {import("./shortcuts.js").Shortcut[]}
 */
export function shortcuts({ store, player, tools, graph, files, stage, help }) {
  return [
    { keys: "Space", words: "play, pause", press: [" "], act: () => player.toggle() },
    { keys: ", .", words: "one frame back, on", press: [","], act: () => player.step(-1) },
    { keys: "Shift+← →", words: "ten frames back, on", press: ["Shift+ArrowLeft"], act: () => player.step(-10) },
    { keys: "Home End", words: "to in, to out", press: ["Home"], act: () => player.seek(player.from) },
    { keys: "I O", words: "in, out; once more: neither", press: ["i"], act: () => player.mark(0) },
    { keys: "Ctrl+Z, Ctrl+Shift+Z", words: "undo, redo, of this variant", press: ["Ctrl+z"], act: () => store.undo() },
    { keys: "Ctrl+S", words: "save the curve as a file", press: ["Ctrl+s"], act: () => files.save() },
    { keys: "Ctrl+C, Ctrl+V", words: "copy points, paste them at the time at hand", press: ["Ctrl+c"], act: () => tools.copy() },
    { keys: "Ctrl+A", words: "select all points", press: ["Ctrl+a"], act: () => tools.all() },
    { keys: "Del", words: "delete the selected points", press: ["Delete", "Backspace"], act: () => tools.remove() },
    { keys: "H", words: "hold: a pause at the time at hand", press: ["h"], act: () => tools.hold() },
    { keys: "F", words: "show the whole motion", press: ["f"], act: () => graph.zoom(null) },
    { keys: "0 1 3 7", words: "look from the start, front, side, top", press: ["0"], act: () => stage.look("own") },
    { keys: "?", words: "this list", press: ["?"], act: help },
    { keys: "Esc", words: "take back the drag at hand; close", press: ["Escape"], act: () => { if (!store.cancel()) graph.select({}); } },
    ...silent(store, player, tools, stage),
  ];
}

/** The second key of a pair: no line of its own in the list. @param {import("./store.js").Store} store @param {import("./player.js").Player} player @param {import("./tools.js").Tools} tools @param {import("./stage.js").Stage} stage @returns {import("./shortcuts.js").Shortcut[]} */
function silent(store, player, tools, stage) {
  /** @type {[string, () => void][]} */
  const pairs = [
    [".", () => player.step(1)], ["Shift+ArrowRight", () => player.step(10)], ["End", () => player.seek(player.to)], ["o", () => player.mark(1)],
    ["Ctrl+Shift+z", () => store.redo()], ["Ctrl+y", () => store.redo()], ["Ctrl+v", () => tools.paste()],
    ["1", () => stage.look("front")], ["3", () => stage.look("side")], ["7", () => stage.look("top")], ["l", () => $("loop").click()],
  ];
  return pairs.map(([press, act]) => ({ keys: "", words: "", press: [press], act }));
}
