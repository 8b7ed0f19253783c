// What the policy makes of the imported curves: each is simulated once, after whatever is edited.

import { signOf } from "./report.js";

/** @import { Curve } from "./types.js" */

export class Judging extends EventTarget {
  /** @param {import("./link.js").Link} link @param {import("./store.js").Store} store */
  constructor(link, store) {
    super();
    this.link = link;
    this.store = store;
    /** @type {Map<string, string>} by the curve */
    this.words = new Map();
    this.busy = false;
    this.server = 0; // counts the servers: another one may have another policy
  }

  /** A server that knows nothing of what was said before. */
  begin() {
    this.server += 1;
    this.words.clear();
  }

  /** What came of a curve, in a few words; none yet: an empty text. @param {Curve} curve */
  of(curve) { return this.words.get(keyOf(curve)) ?? ""; }

  /** Asks for those that were never judged, one after the other. */
  async update() {
    if (this.busy) return;
    this.busy = true;
    for (let next = this.next(); next && this.link.open; next = this.next()) {
      const { server } = this, said = await this.judge(next);
      if (server !== this.server) continue;
      if (said === null) break;
      this.words.set(keyOf(next), said);
      this.dispatchEvent(new Event("change"));
    }
    this.busy = false;
  }

  /** @returns {Curve | undefined} */
  next() { return this.store.project?.imported.map((one) => one.curve).find((curve) => !this.words.has(keyOf(curve))); }

  /** Null where the connection was lost. @param {Curve} curve */
  async judge(curve) {
    try {
      const said = await this.link.ask({ type: "judge", curve });
      return `${signOf(said)} ${said.verdict}`;
    } catch (error) { return this.link.open ? `✗ ${/** @type {Error} */ (error).message}` : null; }
  }
}

/** Names change nothing. @param {Curve} curve */
function keyOf({ name, strategy, ...curve }) { return JSON.stringify(curve); }
