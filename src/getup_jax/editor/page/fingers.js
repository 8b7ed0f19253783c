// Two fingers on a curve: they zoom the time and move along it, and the page stays as it is.

import { pinched } from "./graph_scale.js";

export class Fingers {
  /** @param {import("./panel.js").Panel} panel @param {() => void} cancel takes back what the first finger began */
  constructor(panel, cancel) {
    this.panel = panel;
    this.cancel = cancel;
    /** @type {Map<number, PointerEvent>} those on the glass, as they were last */
    this.down = new Map();
    const { svg } = panel;
    svg.addEventListener("pointerdown", (event) => this.press(event), { capture: true });
    svg.addEventListener("pointermove", (event) => this.move(event));
    for (const end of /** @type {const} */ (["pointerup", "pointercancel"])) svg.addEventListener(end, (event) => this.down.delete(event.pointerId));
  }

  /** @param {PointerEvent} event */
  press(event) {
    if (event.pointerType !== "touch") return;
    this.down.set(event.pointerId, event);
    if (this.down.size < 2) return;
    event.stopPropagation(); // no gesture of its own
    event.preventDefault();
    this.panel.svg.setPointerCapture(event.pointerId);
    this.cancel();
  }

  /** @param {PointerEvent} event */
  move(event) {
    const before = this.down.get(event.pointerId);
    if (!before) return;
    this.down.set(event.pointerId, event);
    const other = [...this.down.values()].find((one) => one !== event);
    if (!other || this.down.size > 2) return;
    const left = this.panel.svg.getBoundingClientRect().left, { graph, scale } = this.panel;
    const at = (/** @type {PointerEvent} */ e) => [e.clientX - left, e.clientY];
    graph.zoom(pinched(scale, at(other), at(before), at(event)));
  }
}
