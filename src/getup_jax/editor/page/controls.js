// The controls below the curves and in the header; they change the store and follow it.

import { alike } from "./alike.js";
import { duration, DURATION_S, keptDuration, keptName, sameCurve } from "./content.js";
import { group, option } from "./dom.js";
import * as edits from "./edits.js";
import { clamp, LIES } from "./features.js";
import { say } from "./notice.js";
import { startGap } from "./starts.js";

/** @import { Curve } from "./types.js" */

export class Controls {
  /** @param {Record<string, any>} elements @param {import("./store.js").Store} store @param {() => void} onGuide */
  constructor(elements, store, onGuide) {
    this.elements = elements;
    this.store = store;
    /** @type {any} */
    this.scene = null;
    this.listed = this.startsShown = "";
    this.judged = (/** @type {Curve} */ _) => ""; // what the policy makes of a curve
    const { curve, band, start, region, place, duration: slider, seconds, shift } = elements;
    curve.addEventListener("change", () => this.choose(curve.value));
    band.addEventListener("change", onGuide);
    start.addEventListener("change", () => this.startFrom(start.value));
    region.addEventListener("change", () => store.commit((now) => ({ ...now, region: Number(region.value) })));
    // a field that is left empty goes back to what it was
    place.addEventListener("change", () => (place.value === "" ? this.show() : this.place(Number(place.value))));
    seconds.addEventListener("change", () => (seconds.value === "" ? this.show() : this.last(Number(seconds.value))));
    this.slide(slider, edits.last, "duration");
    this.slide(shift, edits.shift);
    this.listenToName(elements.name);
    elements.undo.addEventListener("click", () => store.undo());
    elements.redo.addEventListener("click", () => store.redo());
    elements.reset.addEventListener("click", () => store.commit(edits.reset));
    elements.mirror.addEventListener("click", () => store.commit((now) => edits.mirror(now, this.scene.mirrored, this.scene.mirror)));
  }

  /** A draft follows the slider. One that is taken back, as by Escape or undo, stays so until the slider is let go.
   * @param {HTMLInputElement} slider @param {(now: import("./types.js").Content, amount: number) => import("./types.js").Content} edit */
  slide(slider, edit, tag = "") {
    let begun = false;
    for (const again of ["pointerdown", "focus"]) slider.addEventListener(again, () => { begun = false; });
    slider.addEventListener("input", () => {
      if (begun && !this.store.draft) return this.show();
      begun = true;
      this.store.live((now) => edit(now, Number(slider.value)));
    });
    slider.addEventListener("change", () => {
      begun = false;
      this.store.commit(null, { tag });
    });
  }

  /** What a file's name may not have cannot be typed. @param {HTMLInputElement} name */
  listenToName(name) {
    name.addEventListener("input", (event) => {
      if (/** @type {InputEvent} */ (event).isComposing) return;
      const kept = keptName(name.value);
      if (kept === name.value) return;
      const left = (name.selectionStart ?? kept.length) - (name.value.length - kept.length);
      name.value = kept;
      name.setSelectionRange(left, left);
      say("A name has letters, digits, spaces and _ - . @ : ~ alone.");
    });
    name.addEventListener("change", () => this.rename(name));
  }

  /** @param {HTMLInputElement} name */
  rename(name) {
    const kept = keptName(name.value).trim() || "my_rise";
    name.value = kept;
    this.store.commit((now) => edits.withCurve(now, { name: kept }));
  }

  /** The starts and the guides that the server knows. @param {any} scene */
  fill(scene) {
    this.scene = scene;
    this.listed = "";
    const { band, region, place } = this.elements, guide = band.value;
    const bands = Object.entries(scene.bands).map(([name, { count }]) => option(name, `${name} (${count})`));
    band.replaceChildren(option("", "none"), ...bands);
    band.value = guide;
    region.replaceChildren(...(scene.terrain?.regions ?? ["flat"]).map((/** @type {string} */ name, /** @type {number} */ i) => option(String(i), name)));
    region.disabled = place.disabled = scene.terrain === null;
    region.title = scene.terrain ? "Where it gets up" : "This policy was trained on flat ground only";
    place.max = scene.terrain?.places ?? 1;
  }

  /** Curves to begin with: the library's by how they lie, the drawn ones, the imported ones. */
  fillCurves() {
    const imported = this.store.project?.imported ?? [], { starts, curves } = this.scene;
    const words = imported.map(({ curve }) => this.judged(curve));
    const listed = [this.store.project?.id, imported.length, ...words].join();
    if (listed === this.listed) return;
    this.listed = listed;
    const references = new Map(starts.map((/** @type {any} */ s) => [s.name, s.lies]));
    const of = (/** @type {string | undefined} */ lies) => curves.flatMap((/** @type {Curve} */ c, /** @type {number} */ i) => (references.get(c.name) === lies ? [option(`c${i}`, c.name)] : []));
    const own = imported.map(({ curve, file }, i) => {
      const parts = [file, `${curve.durations[0].toFixed(1)} s`, alike(curve, curves), words[i]].filter(Boolean);
      return option(`i${i}`, `${curve.name} (${parts.join(", ")})`);
    });
    const groups = [...LIES.map((lies) => group(lies, of(lies))), group("drawn", of(undefined)), group("imported", own)];
    this.elements.curve.replaceChildren(option("", "choose …"), ...groups.filter((g) => g.children.length));
  }

  /** @param {string} value */
  choose(value) {
    const curve = this.curveOf(value);
    if (curve) this.store.commit((now) => edits.choose(now, curve));
  }

  /** @param {string} name */
  startFrom(name) {
    const first = edits.firstOf(this.scene, name), gap = startGap(this.store.now, first);
    this.store.commit((now) => edits.startFrom(now, name, first));
    if (gap > this.scene.match_deg) say(`The curves now begin ${gap.toFixed(0)}° from where they did: this pose does not lead into them by itself.`);
  }

  /** @param {number} typed */
  last(typed) {
    const kept = keptDuration(typed);
    this.store.commit((now) => edits.last(now, typed));
    this.elements.seconds.value = kept;
    if (kept !== typed) say(`Duration: from ${DURATION_S[0]} to ${DURATION_S[1]} s; it is ${kept} s now.`);
  }

  /** @param {number} typed */
  place(typed) {
    const kept = clamp(Math.round(typed) || 1, 1, this.scene.terrain.places);
    this.store.commit((now) => ({ ...now, place: kept - 1 }));
    this.elements.place.value = kept;
    if (kept !== typed) say(`Place: a whole number from 1 to ${this.scene.terrain.places}; it is ${kept} now.`);
  }

  /** Shows the store. */
  show() {
    const { elements, store } = this, { now, current } = store, seconds = duration(now);
    if (document.activeElement !== elements.name) elements.name.value = now.curve.name;
    elements.duration.value = seconds;
    if (!store.draft) elements.shift.value = 0;
    if (document.activeElement !== elements.seconds || elements.seconds.value === "") elements.seconds.value = seconds;
    elements.region.value = now.region;
    if (document.activeElement !== elements.place) elements.place.value = now.place + 1;
    elements.undo.disabled = !store.undoable && !store.draft;
    elements.redo.disabled = !current.history.future.length;
    this.fillCurves();
    if (!store.draft) this.fillStarts();
    const named = [...elements.curve.options].filter((o) => this.curveOf(o.value)?.name === now.reference.name);
    const chosen = named.find((o) => sameCurve(/** @type {Curve} */ (this.curveOf(o.value)), now.reference)) ?? named[0];
    elements.curve.value = chosen ? chosen.value : "";
  }

  /** @param {string} value of an option @returns {Curve | undefined} */
  curveOf(value) {
    const i = Number(value.slice(1));
    return value[0] === "c" ? this.scene.curves[i] : value[0] === "i" ? this.store.project?.imported[i]?.curve : undefined;
  }

  /** Every start with how far it is from where the curves begin; one that the server does not list as it is. */
  fillStarts() {
    const { start } = this.elements, { scene, store } = this, { curve } = store.now;
    const named = (/** @type {string} */ name) => {
      const gap = startGap(store.now, edits.firstOf(scene, name));
      return [name, name === curve.start && !curve.pose ? name : gap > scene.match_deg ? `${name} – ${gap.toFixed(0)}° off` : name];
    };
    const groups = LIES.map((lies) => {
      const names = scene.starts.filter((/** @type {any} */ s) => s.lies === lies).map((/** @type {any} */ s) => s.name);
      const all = scene.mirrored === null ? names : names.flatMap((/** @type {string} */ n) => [n, scene.mirrored + n]);
      return { lies, options: all.map(named) };
    }).filter(({ options }) => options.length);
    const known = groups.some(({ options }) => options.some((/** @type {string[]} */ [name]) => name === curve.start));
    const own = known && !curve.pose ? null : `${curve.start} (${curve.pose ? "its own pose" : "unknown here"})`;
    const text = JSON.stringify([groups, own]);
    if (text !== this.startsShown) {
      const lists = groups.map(({ lies, options }) => group(lies, options.map((/** @type {string[]} */ [name, words]) => option(name, words))));
      start.replaceChildren(...lists, ...(own === null ? [] : [option(curve.start, own, true)]));
    }
    this.startsShown = text;
    if (own !== null) start.selectedIndex = start.options.length - 1;
    else if (start.value !== curve.start) start.value = curve.start;
  }
}
