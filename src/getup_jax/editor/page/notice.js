// One line at the top for a moment: what was done, or why not; with a button where it can be taken back.

import { $, el } from "./dom.js";

const SHORT_MS = 4000, LONG_MS = 9000;
let timer = 0;

/** @param {string} text @param {boolean} bad @param {{ words: string, act: () => void } | null} button */
export function say(text, bad = false, button = null) {
  const toast = $("toast");
  toast.replaceChildren(text);
  if (button) {
    const press = () => {
      hide();
      button.act();
    };
    toast.append(" ", el("button", { onclick: press }, button.words));
  }
  if (toast.hidePopover) { // above an open dialog too
    toast.popover = "manual";
    if (toast.matches(":popover-open")) toast.hidePopover();
    toast.showPopover();
  }
  toast.className = bad ? "shown bad" : "shown";
  clearTimeout(timer);
  timer = setTimeout(hide, bad || button ? LONG_MS : SHORT_MS);
}

function hide() { $("toast").className = ""; }
