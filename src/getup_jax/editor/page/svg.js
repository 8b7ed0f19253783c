// SVG elements.

/** @typedef {{ name: string, attributes: Record<string, string | number>, title?: string }} Part an element that is to be there; title: words that a mouse finds */

const NS = "http://www.w3.org/2000/svg";

/** @param {string} name @param {Record<string, string | number>} attributes @returns {SVGElement} */
export function make(name, attributes = {}) {
  const element = document.createElementNS(NS, name);
  set(element, attributes);
  return element;
}

/** What stays as it is, is not written: the browser would lay the whole drawing out anew. @param {Element} element @param {Record<string, unknown>} attributes */
export function set(element, attributes) {
  for (const [key, value] of Object.entries(attributes)) {
    const text = String(value);
    if (element.getAttribute(key) !== text) element.setAttribute(key, text);
  }
}

/** Makes an element's children like some others that are only described; those of the same kind are kept. @param {Element} root @param {Part[]} parts */
export function fill(root, parts) {
  parts.forEach(({ name, attributes, title }, i) => {
    let element = root.children[i];
    if (element?.localName !== name) {
      const made = make(name);
      if (element) element.replaceWith(made);
      else root.append(made);
      element = made;
    }
    set(element, attributes);
    if (element.textContent === (title ?? "")) return;
    element.replaceChildren(...(title ? [titled(title)] : []));
  });
  while (root.children.length > parts.length) root.lastElementChild?.remove();
}

/** @param {string} words */
function titled(words) {
  const title = make("title");
  title.textContent = words;
  return title;
}

/** @param {number} x @param {number} y @param {string} content @param {Record<string, string | number>} attributes */
export function text(x, y, content, attributes = {}) {
  const element = make("text", { x, y, ...attributes });
  element.textContent = content;
  return element;
}

/** @param {string} kind its class @param {string[]} points @param {string} [title] @returns {Part} */
export function polyline(kind, points, title) {
  return { name: "polyline", attributes: { class: kind, points: points.join(" ") }, title };
}
