// The variants as tabs, with a button for a further one, one to remove the active one, and a list of the removed ones.

import { el, option } from "./dom.js";
import { say } from "./notice.js";
import { LETTERS, SLOTS } from "./project.js";

export class Tabs {
  /** @param {HTMLElement} root @param {import("./store.js").Store} store */
  constructor(root, store) {
    this.root = root;
    this.store = store;
    this.shown = "";
  }

  /** Only what changed is made anew: curves are edited far more often than variants. */
  draw() {
    const { root, store } = this;
    const removed = store.project?.removed ?? [], names = removed.map(({ slot, history }) => `${LETTERS[slot]}: ${history.now.curve.name}, ${history.now.curve.durations[0]} s`);
    const shown = `${store.active} of ${store.variants.map((v) => v.slot)}, without ${names}`;
    if (shown === this.shown) return;
    this.shown = shown;
    const buttons = store.variants.map(({ slot }) => this.tab(slot));
    const full = store.variants.length >= SLOTS;
    buttons.push(el("button", { title: "A copy to compare with: the others stay as ghosts", disabled: full, onclick: () => store.addVariant() }, "+ variant"));
    if (store.variants.length > 1) {
      const words = "Remove this variant";
      buttons.push(el("button", { title: words, "aria-label": words, onclick: () => this.remove() }, "×"));
    }
    if (removed.length) {
      const words = "Put back a variant that was removed", back = (/** @type {any} */ { target }) => this.putBack(store.project?.removed[Number(target.value)]);
      buttons.push(el("select", { id: "removed", title: words, "aria-label": words, onchange: back }, option("", "Removed…"), ...names.map((name, i) => option(String(i), name)).reverse()));
    }
    const focused = [...root.children].indexOf(/** @type {Element} */ (document.activeElement));
    root.replaceChildren(...buttons);
    if (focused >= 0) /** @type {HTMLElement} */ (root.children[Math.min(focused, buttons.length - 1)]).focus();
  }

  remove() {
    const removed = this.store.removeActive();
    if (removed) say(`Variant ${LETTERS[removed.slot]} is removed.`, false, { words: "Put it back", act: () => this.putBack(removed) });
  }

  /** @param {import("./types.js").Variant | undefined} variant */
  putBack(variant) {
    if (this.store.variants.length >= SLOTS) say("Four variants are the most: remove one first.");
    else if (!variant || !this.store.putBack(variant)) say("It is not among those that were removed from this project.");
    this.shown = ""; // the list says nothing again
    this.draw();
  }

  /** @param {number} slot */
  tab(slot) {
    const active = slot === this.store.active;
    const title = active ? "The variant that you edit" : "Edit this variant; it is the ghost in the view";
    return el("button", { title, class: `swatch${slot}`, role: "tab", "aria-selected": active ? "true" : "false", onclick: () => this.store.show(slot) }, LETTERS[slot]);
  }
}
