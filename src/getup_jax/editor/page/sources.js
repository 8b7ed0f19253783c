// The motions behind the curves: kept with what was imported, asked for where the library has it.

import { sameCurve } from "./content.js";
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

  /** Whether there is one behind the curve at hand; none where it starts elsewhere, as its mirror image does. */
  get any() {
    if (!this.store.project) return false;
    const { curve, reference } = this.store.now;
    const same = curve.start === reference.start && JSON.stringify(curve.pose) === JSON.stringify(reference.pose);
    return same && Boolean(this.own?.recording || this.library.has(reference.name));
  }

  /** @returns {Recording | null} */
  get recording() { return this.any ? this.own?.recording ?? this.known.get(this.store.now.reference.name) ?? null : null; }

  /** What was imported as the curve at hand; several files may have one name. */
  get own() {
    const { reference } = this.store.now, named = this.store.project?.imported.filter((one) => one.curve.name === reference.name) ?? [];
    return named.find((one) => sameCurve(one.curve, reference)) ?? named[0];
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
