// One line at the top for a moment: what was done, or why not; with a button where it can be taken back.

import { $, el } from "./dom.js";

const SHORT_MS = 4000, LONG_MS = 9000;
let timer = 0;
/** @type {HTMLElement | null} */
let toast = null;

/** Its element, where it can be seen and pressed: all that is outside of an open dialog is neither. */
function placed() {
  const dialog = $("dialog");
  if (!toast) dialog.addEventListener("close", placed);
  toast ??= /** @type {HTMLElement} */ ($("toast"));
  const host = dialog.open ? dialog : document.body;
  if (toast.parentNode !== host) host.append(toast);
  return toast;
}

/** @param {string} text @param {boolean} bad @param {{ words: string, act: () => void } | null} button @param {boolean} stays until something else is said */
export function say(text, bad = false, button = null, stays = false) {
  const line = placed();
  line.replaceChildren(text);
  if (button) {
    const press = () => {
      hide();
      button.act();
    };
    line.append(" ", el("button", { onclick: press }, button.words));
  }
  line.className = bad ? "shown bad" : "shown";
  clearTimeout(timer);
  if (!stays) timer = setTimeout(hide, bad || button ? LONG_MS : SHORT_MS);
}

function hide() { if (toast) toast.className = ""; }
