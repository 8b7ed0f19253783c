// The motions behind the curves: kept with what was imported, asked for where the library has it.

import { sameCurve } from "./content.js";
import { mirrorPose } from "./edits.js";
import { recordings } from "./files.js";
import { mirrored } from "./motion_recording.js";

/** @import { Curve, Recording } from "./types.js" */

const SAME = 1e-6; // of two poses: they are stored with as many digits

export class Sources extends EventTarget {
  /** @param {import("./link.js").Link} link @param {import("./store.js").Store} store */
  constructor(link, store) {
    super();
    this.link = link;
    this.store = store;
    /** @type {Set<string>} names of the library's clips */
    this.library = new Set();
    /** @type {import("./edits.js").Mirror & { link: number[], word: string | null }} word: before the name of a mirrored start */
    this.mirror = { joint: [], sign: [], link: [], word: null };
    /** @type {Map<string, Recording | null>} of the library; null: on its way */
    this.known = new Map();
    this.wanted = false;
  }

  /** Which one is behind the curve at hand: the motion itself, or its mirror image; null where the curve starts elsewhere. @returns {"itself" | "mirrored" | null} */
  get side() {
    if (!this.store.project) return null;
    const { curve, reference } = this.store.now, { own } = this;
    if (own?.recording) return this.sideOf(curve, own.curve);
    return this.library.has(reference.name) ? this.sideOf(curve, { ...reference, start: this.plainStart(reference) }) : null;
  }

  get any() { return this.side !== null; }

  /** @param {Curve} curve @param {Curve} original */
  sideOf(curve, original) {
    if (curve.pose && original.pose) {
      if (alike(curve.pose, original.pose)) return "itself";
      return alike(curve.pose, mirrorPose(original.pose, this.mirror)) ? "mirrored" : null;
    }
    if (curve.pose || original.pose || this.plainStart(curve) !== this.plainStart(original)) return null;
    return curve.start === original.start ? "itself" : "mirrored";
  }

  /** The start's name without the word that says that it is mirrored. @param {Curve} curve */
  plainStart({ start }) {
    const { word } = this.mirror;
    return word !== null && start.startsWith(word) ? start.slice(word.length) : start;
  }

  /** @returns {Recording | null} */
  get recording() {
    const { side } = this, found = side && (this.own?.recording ?? this.known.get(this.store.now.reference.name));
    if (!found) return null;
    return side === "mirrored" ? mirrored(found, this.mirror.link) : found;
  }

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

/** @param {number[]} a @param {number[]} b */
function alike(a, b) { return a.length === b.length && a.every((x, i) => Math.abs(x - b[i]) < SAME); }
