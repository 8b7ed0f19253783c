// The variants as tabs, with a button for a further one and one to remove the active one.

import { MOST_VARIANTS } from "./store.js";

export class Tabs {
  // onRemove(slot): before the store forgets it
  constructor(root, store, onRemove) { Object.assign(this, { root, store, onRemove }); }

  // Only what changed is made anew: curves are edited far more often than variants.
  draw() {
    const { root, store } = this;
    const shown = `${store.active} of ${store.variants.length}`;
    if (shown === this.shown) return;
    this.shown = shown;
    const buttons = store.variants.map((_, slot) => this.tab(slot));
    const add = button("+ variant", "A copy to compare with: the others stay as ghosts", () => store.addVariant());
    add.disabled = store.variants.length >= MOST_VARIANTS;
    buttons.push(add);
    if (store.variants.length > 1) {
      const remove = button("×", "Remove this variant", () => {
        this.onRemove(store.active);
        store.removeVariant(store.active);
      });
      remove.setAttribute("aria-label", "Remove this variant");
      buttons.push(remove);
    }
    const focused = [...root.children].indexOf(document.activeElement);
    root.replaceChildren(...buttons);
    if (focused >= 0) root.children[Math.min(focused, buttons.length - 1)].focus();
  }

  tab(slot) {
    const active = slot === this.store.active;
    const title = active ? "The variant that you edit" : "Edit this variant; it is the ghost in the view";
    const made = button("ABCD"[slot], title, () => this.store.show(slot));
    made.className = `swatch${slot}`;
    made.setAttribute("role", "tab");
    made.setAttribute("aria-selected", active);
    return made;
  }
}

function button(text, title, press) {
  const made = document.createElement("button");
  made.textContent = text;
  made.title = title;
  made.addEventListener("click", press);
  return made;
}
