// The motions of the variants: asks the server for them and keeps what comes.
//
// Events: "asked" { slot, request }, "frames" { slot, motion, request, first } and "result"
// { slot, motion, request }; a request's `released` is when the edit's gesture ended (null: it goes on).

import { Motion } from "./motion.js";

export class Simulations extends EventTarget {
  constructor(link, store) {
    super();
    Object.assign(this, { link, store, motions: [], sent: [] }); // by slot
    link.addEventListener("ground", ({ detail }) => {
      const request = this.request(detail);
      if (request) request.ground = detail;
    });
    link.addEventListener("frames", ({ detail }) => this.addFrames(detail));
    link.addEventListener("result", ({ detail }) => this.addResult(detail));
    link.addEventListener("error", ({ detail }) => {
      const request = this.sent.find((s) => s?.number === detail.number);
      if (request) request.failed = true;
    });
  }

  // A server that knows nothing of earlier requests.
  begin(scene) {
    this.links = scene.links.length;
    this.sent.length = 0;
  }

  // Asks for what changed; released: when the gesture on the active variant ended.
  update(released) {
    const { variants, active } = this.store;
    this.motions.length = Math.min(this.motions.length, variants.length);
    this.sent.length = Math.min(this.sent.length, variants.length);
    this.ask(active, released); // others wait, since the server takes one after the other
    variants.forEach((_, slot) => { if (slot !== active) this.ask(slot, null); });
  }

  // Nothing is asked twice, but for the end of a gesture. While a gesture goes on the next request
  // waits for the first frames of the last one.
  ask(slot, released) {
    const { curve, region, place } = this.store.variants[slot];
    const text = JSON.stringify([{ ...curve, name: "" }, region, place]);
    const last = this.sent[slot];
    if (last?.text === text && (released === null || last.released !== null)) return;
    if (last && released === null && !last.arrived && !last.failed && this.link.open) {
      last.due = true;
      return;
    }
    const number = this.link.send({ type: "simulate", slot, curve, region, place });
    const request = { text, number, released, ground: null, arrived: false, failed: false, due: false };
    this.sent[slot] = request;
    this.tell("asked", { slot, request });
  }

  // Later variants move up; what is still to come for them would arrive under their old number.
  remove(slot) {
    this.motions.splice(slot, 1);
    this.sent.splice(slot, 1);
    for (let i = slot; i < this.sent.length; i++) {
      const { result, number } = this.motions[i] ?? {};
      if (!result || number !== this.sent[i]?.number) this.sent[i] = undefined;
    }
  }

  // The request that a message answers; nothing for one of an older edit.
  request({ slot, number }) {
    const request = this.sent[slot];
    return request?.number === number ? request : null;
  }

  addFrames(message) {
    const request = this.request(message), { slot } = message;
    if (!request) return;
    const first = message.first === 0;
    if (first) {
      this.motions[slot] = new Motion(message.number, message.total, this.links, request.ground);
      request.arrived = true;
    }
    const motion = this.motions[slot];
    motion.add(message);
    this.tell("frames", { slot, motion, request, first });
    if (first && request.due) this.ask(slot, null);
  }

  addResult(message) {
    const request = this.request(message), { slot } = message;
    if (!request) return;
    const motion = this.motions[slot];
    motion.result = message;
    this.tell("result", { slot, motion, request });
  }

  tell(type, detail) { this.dispatchEvent(new CustomEvent(type, { detail })); }
}
