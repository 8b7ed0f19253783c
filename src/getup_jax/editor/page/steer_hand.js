// The hand in the view: a click on the floor, a drag of a knob; any other drag orbits, as the view has it.

import { Vector3 } from "./vendor/three.min.js";
import { onFloor } from "./steer_goals.js";

/** @typedef {import("./steer_goals.js").Point} Point */
/** @typedef {{ goal: string, tip: number[] }} Knob */
/** @typedef {{ knobs: () => Knob[], click: (place: [number, number] | null) => void, drag: (goal: string, origin: Point, along: Point) => void }} Acts */

const STILL_PX = 6; // a click moves less
const GRIP_PX = 30;

export class Hand {
  /** @param {import("./view.js").View} view @param {Acts} acts */
  constructor(view, acts) {
    this.view = view;
    this.acts = acts;
    /** @type {{ id: number, x: number, y: number, goal: string | null } | null} */
    this.down = null;
    const { canvas } = view;
    canvas.addEventListener("pointerdown", (event) => this.press(event), { capture: true });
    canvas.addEventListener("pointermove", (event) => this.move(event), { capture: true });
    canvas.addEventListener("pointerup", (event) => this.release(event), { capture: true });
    canvas.addEventListener("pointercancel", () => { this.down = null; });
  }

  /** @param {PointerEvent} event */
  press(event) {
    const second = this.down !== null;
    this.down = null;
    if (second || event.button !== 0) return; // two fingers zoom
    const goal = this.under(event);
    this.down = { id: event.pointerId, x: event.clientX, y: event.clientY, goal };
    if (goal === null) return;
    event.stopImmediatePropagation(); // the camera stays
    this.view.canvas.setPointerCapture(event.pointerId);
  }

  /** @param {PointerEvent} event */
  move(event) {
    if (!this.down) this.view.canvas.style.cursor = this.under(event) === null ? "" : "grab";
    if (this.down?.goal) this.acts.drag(this.down.goal, ...this.ray(event));
  }

  /** @param {PointerEvent} event */
  release(event) {
    const { down } = this;
    this.down = null;
    if (!down || down.id !== event.pointerId || down.goal) return;
    if (Math.hypot(event.clientX - down.x, event.clientY - down.y) <= STILL_PX) this.acts.click(onFloor(...this.ray(event)));
  }

  /** The goal whose knob is there. @param {PointerEvent} event */
  under(event) {
    const box = this.view.canvas.getBoundingClientRect();
    const gaps = this.acts.knobs().map(({ goal, tip }) => {
      const seen = new Vector3(...tip).project(this.view.camera);
      return { goal, gap: Math.hypot(((seen.x + 1) / 2) * box.width + box.left - event.clientX, ((1 - seen.y) / 2) * box.height + box.top - event.clientY) };
    });
    const [nearest] = gaps.sort((a, b) => a.gap - b.gap);
    return nearest && nearest.gap <= GRIP_PX ? nearest.goal : null;
  }

  /** From the camera through the pointer. @param {PointerEvent} event @returns {[Point, Point]} */
  ray(event) {
    const { camera, canvas } = this.view, box = canvas.getBoundingClientRect();
    const x = (2 * (event.clientX - box.left)) / box.width - 1, y = 1 - (2 * (event.clientY - box.top)) / box.height;
    const along = new Vector3(x, y, 0.5).unproject(camera).sub(camera.position).normalize();
    return [camera.position.toArray(), along.toArray()];
  }
}
