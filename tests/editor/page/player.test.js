import assert from "node:assert/strict";
import { test } from "node:test";

import { close } from "./samples.js";
import { Player } from "../../../src/getup_jax/editor/page/player.js";

globalThis.requestAnimationFrame ??= () => 0; // the tests move time on

/** A player of 6 s of motion, 30 frames/s. */
function player({ speed = 1, loop = true } = {}) {
  const element = () => Object.assign(new EventTarget(), { style: {}, textContent: "", value: "", checked: false });
  const elements = Object.fromEntries(["play", "scrub", "clock", "speed", "loop", "first", "back", "on", "in", "out", "range"].map((id) => [id, element()]));
  elements.speed.value = String(speed);
  elements.loop.checked = loop;
  const made = new Player(elements, { span: () => 6, controlDt: 1 / 30, frames: () => false }, () => {}, () => {});
  /** @param {number} seconds */
  const pass = (seconds) => { for (let i = 0; i < Math.round(seconds * 10); i++) made.advance(0.1); };
  return { player: made, elements, pass };
}

test("time passes as fast as the speed says", () => {
  for (const speed of [0.1, 0.5, 2]) {
    const { player: p, pass } = player({ speed });
    pass(2);
    close([p.time], [2 * speed], 1e-6);
  }
});

test("a loop rests at its end and begins again at in; without one it stops there", () => {
  const { player: p, pass, elements } = player();
  p.setRange([1, 3]);
  p.seek(2.5);
  p.toggle(true);
  pass(0.7);
  assert.equal(p.time, 3, "it rests");
  pass(0.7);
  assert.ok(p.time >= 1 && p.time < 1.5, `it went on at ${p.time} s`);
  elements.loop.checked = false;
  pass(4);
  assert.deepEqual([p.time, p.playing, elements.play.textContent], [3, false, "▶"]);
  p.toggle();
  assert.equal(p.time, 1, "played again, it begins at in");
});

test("in and out are the time at hand, once more takes them away, and they never cross", () => {
  const { player: p } = player();
  p.seek(2);
  p.mark(0);
  p.seek(4);
  p.mark(1);
  assert.deepEqual([p.from, p.to], [2, 4]);
  p.seek(5);
  p.mark(0);
  assert.deepEqual([p.from, p.to], [5, 6]);
  p.mark(0);
  assert.equal(p.range, null);
});

test("a step is a frame of the control and stops the player", () => {
  const { player: p, elements } = player();
  p.step(10);
  close([p.time], [1 / 3], 1e-9);
  p.advance(0.1);
  assert.deepEqual([p.playing, elements.clock.textContent], [false, "0.33 s · 10"]);
  elements.on.dispatchEvent(new Event("click"));
  close([p.time], [11 / 30], 1e-9);
});
