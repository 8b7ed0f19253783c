// The motions behind the curves: kept with what was imported, asked for where the library has it.

import { recordings } from "./files.js";

/** @import { Recording } from "./types.js" */

export class Sources extends EventTarget {
  /** @param {import("./link.js").Link} link @param {import("./store.js").Store} store */
  constructor(link, store) {
    super();
    this.link = link;
    this.store = store;
    /** @type {Set<string>} names of the library's clips */
    this.library = new Set();
    /** @type {Map<string, Recording | null>} of the library; null: on its way */
    this.known = new Map();
    this.wanted = false;
  }

  /** The one behind the curve at hand; none where it starts elsewhere, as its mirror image does. @returns {Recording | null} */
  get recording() {
    if (!this.store.project) return null;
    const { curve, reference } = this.store.now;
    if (curve.start !== reference.start) return null;
    const own = this.store.project.imported.find((one) => one.curve.name === reference.name);
    return own?.recording ?? this.known.get(reference.name) ?? null;
  }

  /** Asks for what is to be shown and not there yet. */
  async update() {
    if (!this.wanted || !this.store.project) return;
    const { name } = this.store.now.reference;
    if (!this.library.has(name) || this.known.has(name)) return;
    this.known.set(name, null);
    try {
      const [found] = recordings(await this.link.ask({ type: "recording", name }));
      if (found) this.known.set(name, found);
      this.dispatchEvent(new Event("change"));
    } catch { this.known.delete(name); }
  }
}
