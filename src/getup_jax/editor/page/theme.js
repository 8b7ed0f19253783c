// Light or dark: the system's choice, or the one that was made here.

import { recalled, remember } from "./recall.js";

const KEY = "getup-theme";

/** @param {HTMLElement} button @param {() => void} onChange */
export function watchTheme(button, onChange) {
  const dark = matchMedia("(prefers-color-scheme: dark)");
  let chosen = recalled("localStorage", KEY);
  const apply = () => {
    document.documentElement.dataset.theme = chosen ?? (dark.matches ? "dark" : "light");
    onChange();
  };
  dark.addEventListener("change", apply);
  button.addEventListener("click", () => {
    chosen = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
    remember("localStorage", KEY, chosen);
    apply();
  });
  apply();
}
