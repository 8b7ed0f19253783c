// SVG elements.

const NS = "http://www.w3.org/2000/svg";

export function make(name, attributes = {}) {
  const element = document.createElementNS(NS, name);
  set(element, attributes);
  return element;
}

export function set(element, attributes) {
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
}

export function text(x, y, content, attributes = {}) {
  const element = make("text", { x, y, ...attributes });
  element.textContent = content;
  return element;
}
