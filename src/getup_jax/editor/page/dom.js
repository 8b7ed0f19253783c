// Elements of the page.

/** @param {string} id @returns {any} */
export function $(id) { return document.getElementById(id); }

/** An element with attributes, properties that begin with a dot, and children. @param {string} name @param {Record<string, any>} attributes @param {(Node | string)[]} children @returns {any} */
export function el(name, attributes = {}, ...children) {
  const made = /** @type {any} */ (document.createElement(name));
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
    else if (key.startsWith(".")) made[key.slice(1)] = value;
    else if (value !== false) made.setAttribute(key, value === true ? "" : value);
  }
  made.append(...children);
  return made;
}

/** @param {string} value @param {string} text @param {boolean} disabled */
export function option(value, text, disabled = false) { return el("option", { value, disabled }, text); }

/** @param {string} label @param {HTMLElement[]} options */
export function group(label, options) { return el("optgroup", { label }, ...options); }

/** Writes words where they differ: the browser lays out anew whatever is written. @param {HTMLElement} element @param {string} words */
export function write(element, words) { if (element.textContent !== words) element.textContent = words; }

/** Whether a key that is pressed there belongs to what is typed. @param {EventTarget | null} target */
export function types(target) {
  const { tagName, type } = /** @type {any} */ (target) ?? {};
  return tagName === "TEXTAREA" || (tagName === "INPUT" && (type === "text" || type === "search" || type === "number"));
}

/** Whether a key that is pressed there chooses from a list: letters, numbers and the ends; the space bar where it was reached by Tab. @param {EventTarget | null} target @param {string} key */
export function chooses(target, key) {
  const list = /** @type {any} */ (target);
  if (list?.tagName !== "SELECT") return false;
  return key === " " ? list.matches(":focus-visible") : key.length === 1 || ["Home", "End", "Shift+ArrowLeft", "Shift+ArrowRight"].includes(key);
}

/** @param {string} name @param {BlobPart} content */
export function download(name, content) {
  const anchor = el("a", { href: URL.createObjectURL(new Blob([content])), download: name });
  anchor.click();
  setTimeout(() => URL.revokeObjectURL(anchor.href), 10_000);
}
