// The motions of the variants: asks the server for them, and keeps one result object for each variant,
// which everything that is shown of its motion comes from.
//
// Events: "asked" { request }, "frames" { result, first } and "result" { result }, which has a motion
// and a verdict, or an error.

import { asked } from "./content.js";
import { Motion } from "./motion.js";

/** @import { Content, Result } from "./types.js" */

export class Results extends EventTarget {
  /** @param {import("./link.js").Link} link @param {import("./store.js").Store} store */
  constructor(link, store) {
    super();
    this.link = link;
    this.store = store;
    this.links = 0;
    /** @type {Map<number, Result>} what is shown, by slot */
    this.shown = new Map();
    /** @type {Map<number, Result>} what was asked for last, by slot */
    this.asked = new Map();
    link.addEventListener("ground", (/** @type {any} */ { detail }) => {
      const request = this.request(detail);
      if (request) request.ground = detail;
    });
    link.addEventListener("frames", (/** @type {any} */ { detail }) => this.addFrames(detail));
    link.addEventListener("result", (/** @type {any} */ { detail }) => this.addResult(detail));
    link.addEventListener("error", (/** @type {any} */ { detail }) => this.addError(detail));
  }

  /** A server that knows nothing of earlier requests, and may have another policy: what is shown stays until
   * its own motion is there, but is no answer to what is edited now. @param {{ links: string[] }} scene */
  begin(scene) {
    this.links = scene.links.length;
    this.asked.clear();
    for (const [slot, result] of this.shown) this.shown.set(slot, { ...result, text: "" });
  }

  /** Another project has nothing to do with the motions of the last one. */
  clear() {
    this.asked.clear();
    this.shown.clear();
  }

  /** What is shown of the active variant. */
  get active() { return this.shown.get(this.store.active); }

  /** Whether what is shown of a variant is what it is now. @param {number} slot */
  current(slot) {
    const variant = this.store.variants.find((v) => v.slot === slot), result = this.shown.get(slot);
    return Boolean(variant && result && result.text === textOf(this.store.contentOf(variant)));
  }

  /** Asks for what changed; released: when the gesture on the active variant ended. @param {number | null} released */
  update(released) {
    const { variants, active } = this.store;
    for (const slot of [...this.asked.keys(), ...this.shown.keys()]) {
      if (variants.some((v) => v.slot === slot)) continue;
      this.asked.delete(slot);
      this.shown.delete(slot);
    }
    this.ask(active, released); // others wait, since the server takes one after the other
    for (const { slot } of variants) if (slot !== active) this.ask(slot, null);
  }

  /** Nothing is asked twice, but for the end of a gesture. While a gesture goes on the next request
   * waits for the first frames of the last one. @param {number} slot @param {number | null} released */
  ask(slot, released) {
    const variant = this.store.variants.find((v) => v.slot === slot);
    if (!variant) return;
    const now = this.store.contentOf(variant), text = textOf(now), last = this.asked.get(slot);
    if (last?.text === text && (released === null || last.released !== null)) return;
    if (last && released === null && !last.motion && !last.error && this.link.open) {
      last.due = true;
      return;
    }
    const number = this.link.send({ type: "simulate", slot, ...asked(now) });
    /** @type {Result} */
    const request = { slot, number, text, released, motion: null, verdict: null, error: "", ground: null, due: false };
    this.asked.set(slot, request);
    this.tell("asked", { request });
  }

  /** The request that a message answers; nothing for one of an older edit. @param {{ slot: number, number: number }} message */
  request({ slot, number }) {
    const request = this.asked.get(slot);
    return request?.number === number ? request : null;
  }

  /** @param {any} message */
  addFrames(message) {
    const result = this.request(message);
    if (!result) return;
    const first = message.first === 0;
    if (first) {
      result.motion = new Motion(message.number, message.total, this.links, result.ground);
      this.shown.set(result.slot, result);
    }
    result.motion?.add(message);
    this.tell("frames", { result, first });
    if (first && result.due) this.ask(result.slot, null);
  }

  /** @param {any} message */
  addResult(message) {
    const result = this.request(message);
    if (!result) return;
    result.verdict = message;
    this.tell("result", { result });
  }

  /** A motion that was refused: nothing of an older one is left standing. @param {any} message */
  addError(message) {
    const result = [...this.asked.values()].find((request) => request.number === message.number);
    if (!result) return;
    result.error = message.text;
    result.motion = null;
    this.shown.set(result.slot, result);
    this.tell("result", { result });
    if (result.due) this.ask(result.slot, null);
  }

  /** @param {string} type @param {object} detail */
  tell(type, detail) { this.dispatchEvent(new CustomEvent(type, { detail })); }
}

/** @param {Content} now */
export function textOf(now) { return JSON.stringify(asked(now)); }
