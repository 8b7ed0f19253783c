// What the user edits: a project with up to four variants. Everything that is shown follows from it and
// from the results; nothing else keeps a state of its own.
//
// Event "change" { kind, at }: "live" while a gesture goes on, "commit" at its end (at: when), "show" for
// another variant, "project" for another project.

import { duration } from "./content.js";
import * as history from "./history.js";
import { LETTERS, MOST_IMPORTED, MOST_LETTERS, SLOTS } from "./project.js";

/** @import { Content, Imported, Project, Variant } from "./types.js" */

export class Store extends EventTarget {
  constructor() {
    super();
    /** @type {Project | null} */
    this.project = null;
    /** @type {Content | null} */
    this.draft = null; // of the active variant, while a gesture goes on
    /** @type {Variant | null} */
    this.gone = null; // a variant whose removal was the last that was done: undo puts it back
  }

  /** @returns {Variant[]} */
  get variants() { return this.project?.variants ?? []; }
  get active() { return this.project?.active ?? 0; }
  get current() { return /** @type {Variant} */ (this.variants.find((v) => v.slot === this.active)); }
  get now() { return this.draft ?? this.current.history.now; }

  /** The name of a file of the active variant: with its letter, where there are several. @param {string} file */
  fileName(file) { return this.variants.length > 1 ? file.replace(/(\.[^.]*)$/, `_${LETTERS[this.active]}$1`) : file; }

  get undoable() { return this.gone !== null || this.current.history.past.length > 0; }

  /** What a variant is now. @param {Variant} variant */
  contentOf(variant) { return variant.slot === this.active ? this.now : variant.history.now; }

  /** The longest duration of all variants (s). */
  get longest() { return Math.max(0, ...this.variants.map((variant) => duration(this.contentOf(variant)))); }

  /** @param {Project} project */
  open(project) {
    this.project = project;
    this.draft = this.gone = null;
    this.tell("project");
  }

  /** While a gesture goes on: from the content at its beginning, so that nothing adds up. @param {(now: Content) => Content} change */
  live(change) {
    this.draft = change(this.current.history.now);
    this.tell("live");
  }

  /** The gesture never was. */
  cancel() {
    if (!this.draft) return false;
    this.draft = null;
    this.tell("commit", performance.now());
    return true;
  }

  /** The end of a gesture, or a change at once. @param {((now: Content) => Content) | null} change @param {{ at?: number, tag?: string }} how */
  commit(change = null, { at = performance.now(), tag = "" } = {}) {
    const now = change ? change(this.now) : this.now;
    this.draft = null;
    this.write(history.record(this.current.history, now, tag, at));
    this.tell("commit", at);
  }

  undo() {
    if (this.gone && !this.draft) this.putBack(this.gone);
    else this.step(history.undo);
  }

  redo() { this.step(history.redo); }

  /** @param {typeof history.undo} to */
  step(to) {
    if (this.cancel()) return;
    this.write(to(this.current.history));
    this.tell("commit", performance.now());
  }

  /** @param {import("./types.js").History} written */
  write(written) {
    const { slot } = this.current;
    if (written !== this.current.history) this.gone = null;
    this.change({ variants: this.variants.map((v) => (v.slot === slot ? { slot, history: written } : v)) });
  }

  /** @param {Partial<Project>} changed */
  change(changed) { this.project = { .../** @type {Project} */ (this.project), ...changed }; }

  /** A copy of the active variant, in the first free slot. */
  addVariant() {
    const slot = this.freeSlot();
    if (slot === undefined) return;
    this.commit();
    const copy = { slot, history: history.begin(this.now) };
    this.gone = null;
    this.change({ variants: [...this.variants, copy].sort((a, b) => a.slot - b.slot), active: slot });
    this.tell("commit", performance.now());
  }

  /** Gives the variant that was removed; the project keeps the last ones, for those who want them back. */
  removeActive() {
    if (this.variants.length < 2) return null;
    this.draft = null;
    const removed = this.current, variants = this.variants.filter((v) => v !== removed);
    const kept = [.../** @type {Project} */ (this.project).removed, removed].slice(-SLOTS);
    this.change({ variants, active: variants[0].slot, removed: kept });
    this.gone = removed;
    this.tell("show");
    return removed;
  }

  /** A removed variant comes back, under its letter where that is free; false where there are four already. @param {Variant} variant */
  putBack(variant) {
    const { removed } = /** @type {Project} */ (this.project), slot = this.freeSlot(variant.slot);
    if (slot === undefined || !removed.includes(variant)) return false;
    this.commit(); // a gesture that goes on ends with the variant that it was made on
    this.gone = null;
    this.change({ variants: [...this.variants, { ...variant, slot }].sort((a, b) => a.slot - b.slot), active: slot, removed: removed.filter((v) => v !== variant) });
    this.tell("show");
    return true;
  }

  /** The one that is preferred, or the first one that is free. @param {number} preferred */
  freeSlot(preferred = 0) { return [preferred, 0, 1, 2, 3].find((i) => !this.variants.some((v) => v.slot === i)); }

  /** @param {number} slot */
  show(slot) {
    if (slot === this.active) return;
    this.commit(); // a gesture that goes on ends with the variant that it was made on
    this.gone = null;
    this.change({ active: slot });
    this.tell("show");
  }

  /** @param {string} name */
  rename(name) {
    this.change({ name });
    this.tell("show");
  }

  /** Adds as many as a project may hold, and gives the number of those that are left out. @param {Imported[]} imported */
  addImported(imported) {
    const all = [.../** @type {Project} */ (this.project).imported, ...imported];
    const kept = all.slice(0, MOST_IMPORTED).map((one) => ({ ...one, file: one.file.slice(0, MOST_LETTERS) }));
    this.change({ imported: kept });
    this.tell("show");
    return all.length - kept.length;
  }

  /** @param {string} kind @param {number | null} at */
  tell(kind, at = null) { this.dispatchEvent(new CustomEvent("change", { detail: { kind, at } })); }
}
