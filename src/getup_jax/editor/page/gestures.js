// The hand in a panel: select, box-select, move, scale, add and delete keys, scrub, zoom and pan.

import { duration } from "./content.js";
import * as edits from "./edits.js";
import { Fingers } from "./fingers.js";
import { BOTTOM, LEFT, RIGHT, snapped, zoomed } from "./graph_scale.js";
import { valueAt } from "./keys.js";
import * as selection from "./selection.js";
import { make, set } from "./svg.js";

const CLICK_PX = 4; // a press that moves less is a click
const NEAR_PX = 14; // a double click as near puts the key onto the curve
const SIDES = ["left", "right", "top", "bottom"];

export class Gestures {
  /** @param {import("./panel.js").Panel} panel */
  constructor(panel) {
    this.panel = panel;
    this.graph = panel.graph;
    const { svg } = panel;
    svg.addEventListener("pointerdown", (event) => this.press(event));
    svg.addEventListener("dblclick", (event) => this.add(event));
    svg.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    this.box = make("rect", { class: "box", visibility: "hidden" });
    this.frame = make("rect", { class: "frame", visibility: "hidden" });
    this.handles = SIDES.map((side) => {
      const handle = make("rect", { class: `handle ${side}`, width: 8, height: 8, visibility: "hidden" });
      handle.addEventListener("pointerdown", (event) => this.scale(event, side));
      return handle;
    });
    /** @type {((e: PointerEvent | null) => void) | null} */
    this.stop = null; // ends the gesture at hand
    new Fingers(panel, () => this.stop?.(null));
    panel.over.append(this.box, this.frame, ...this.handles);
  }

  /** @param {number} i */
  makePoint(i) {
    const dot = make("circle", { class: "point", r: 6, tabindex: 0, role: "slider", "data-point": i });
    dot.addEventListener("pointerdown", (event) => this.move(event, i));
    dot.addEventListener("keydown", (event) => this.key(event, i));
    dot.addEventListener("focus", () => {
      if (dot.matches(":focus-visible") && !this.chosen.includes(i)) this.graph.select({ [this.panel.feature]: [i] });
    });
    return dot;
  }

  get chosen() { return this.graph.chosen[this.panel.feature] ?? []; }

  /** Where an event is in the panel (px). @param {MouseEvent} event */
  at(event) {
    const box = this.panel.svg.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  /**
   * Follows the pointer until it is released; Escape, or a pointer that the system takes away, undoes it.
   * @param {PointerEvent} event @param {(e: PointerEvent) => void} move @param {(e: PointerEvent | null) => void} end null: it was taken back
   */
  follow(event, move, end) {
    const { svg } = this.panel, own = new AbortController(), { signal } = own;
    svg.setPointerCapture(event.pointerId);
    const stop = (/** @type {PointerEvent | null} */ e) => {
      own.abort();
      this.stop = null;
      end(e);
    };
    this.stop = stop;
    svg.addEventListener("pointermove", (e) => { if (e.pointerId === event.pointerId) move(e); }, { signal });
    svg.addEventListener("pointerup", (e) => stop(e), { signal });
    svg.addEventListener("pointercancel", () => stop(null), { signal });
    document.addEventListener("keydown", (e) => {
      if (e.key !== "Escape") return;
      e.stopPropagation();
      stop(null);
    }, { signal, capture: true });
  }

  /** A gesture that edits: the store's draft follows it. One whose draft is taken back from elsewhere, as by undo, is over.
   * @param {PointerEvent} event @param {(e: PointerEvent) => void} move */
  edit(event, move) {
    const { store } = this.graph;
    let begun = false;
    event.preventDefault();
    event.stopPropagation();
    this.panel.hold(true);
    const go = (/** @type {PointerEvent} */ e) => {
      if (begun && !store.draft) return this.stop?.(null);
      move(e);
      begun = store.draft !== null;
    };
    this.follow(event, go, (e) => {
      this.panel.hold(false);
      if (e) store.commit(null, { at: e.timeStamp });
      else store.cancel();
    });
  }

  /** @param {PointerEvent} event @param {number} i */
  move(event, i) {
    if (event.button !== 0 || event.altKey) return;
    const { graph, panel } = this, { feature } = panel;
    if (event.shiftKey) graph.select(selection.toggled(graph.chosen, feature, i));
    else if (!this.chosen.includes(i)) graph.select({ [feature]: [i] });
    panel.points[i].focus({ preventScroll: true });
    if (!this.chosen.includes(i)) return;
    const { scale } = panel, key = panel.keys[i], picked = graph.chosen, seconds = duration(graph.store.now);
    const [x0, y0] = this.at(event), offset = [x0 - scale.x(key.time * seconds), y0 - scale.y(key.value)];
    let moved = false;
    this.edit(event, (e) => {
      const [x, y] = this.at(e);
      moved ||= Math.hypot(x - x0, y - y0) >= CLICK_PX;
      if (!moved) return;
      // what hardly leaves a line stays on it, so that a value is changed without the time
      const straight = Math.abs(x - x0) < 3 * CLICK_PX && Math.abs(y - y0) > Math.abs(x - x0);
      const level = Math.abs(y - y0) < 3 * CLICK_PX && Math.abs(x - x0) > Math.abs(y - y0);
      const time = straight ? key.time : graph.share(scale.time(x - offset[0]), e.ctrlKey);
      const value = scale.value(y - offset[1]), step = panel.kind.step;
      const to = level ? key.value : graph.snap && !e.ctrlKey ? snapped(value, step) : value;
      graph.store.live((now) => selection.move(now, picked, time - key.time, { [feature]: to - key.value }));
    });
  }

  /** The frame's side is drawn: the keys of all curves in time, those of this one in value. @param {PointerEvent} event @param {string} side */
  scale(event, side) {
    if (event.button !== 0) return;
    const { graph, panel } = this, { scale, feature, keys } = panel, picked = graph.chosen, seconds = duration(graph.store.now);
    const times = this.chosen.map((i) => keys[i].time), values = this.chosen.map((i) => keys[i].value);
    const across = side === "left" || side === "right";
    const edges = across ? times : values, far = side === "right" || side === "top" ? Math.min(...edges) : Math.max(...edges);
    const near = side === "right" || side === "top" ? Math.max(...edges) : Math.min(...edges);
    this.edit(event, (e) => {
      const [x, y] = this.at(e), to = across ? scale.time(x) / seconds : scale.value(y);
      const factor = Math.max((to - far) / (near - far), 0.02);
      graph.store.live((now) => selection.scale(now, picked, across ? { time: far, factor } : { values: { [feature]: { about: far, factor } } }));
    });
  }

  /** On nothing: the axis scrubs, Alt or the middle button pans, else a click goes to a time and a drag selects. @param {PointerEvent} event */
  press(event) {
    if (/** @type {Element} */ (event.target).closest(".point, .handle")) {
      if (!event.altKey && event.button === 0) return;
    }
    const [x0, y0] = this.at(event);
    if (event.button === 1 || (event.button === 0 && event.altKey)) this.pan(event, x0);
    else if (event.button === 0 && y0 > this.panel.height - BOTTOM) this.scrub(event);
    else if (event.button === 0) this.select(event, x0, y0);
  }

  /** @param {PointerEvent} event */
  scrub(event) {
    const go = (/** @type {PointerEvent} */ e) => this.graph.seek(this.panel.scale.time(this.at(e)[0]));
    this.follow(event, go, () => {});
    go(event);
  }

  /** @param {PointerEvent} event @param {number} x0 */
  pan(event, x0) {
    event.preventDefault();
    const { graph, panel } = this, { scale } = panel;
    this.follow(event, (e) => {
      const by = scale.time(x0) - scale.time(this.at(e)[0]);
      graph.zoom([scale.times[0] + by, scale.times[1] + by]);
    }, () => {});
  }

  /** @param {PointerEvent} event @param {number} x0 @param {number} y0 */
  select(event, x0, y0) {
    const { graph, panel } = this, { scale, feature } = panel, seconds = duration(graph.store.now), before = graph.chosen;
    let boxed = false;
    this.follow(event, (e) => {
      const [x, y] = this.at(e);
      boxed ||= Math.hypot(x - x0, y - y0) >= CLICK_PX;
      if (!boxed) return;
      set(this.box, { x: Math.min(x, x0), y: Math.min(y, y0), width: Math.abs(x - x0), height: Math.abs(y - y0), visibility: "visible" });
      const found = selection.inside(panel.keys, [scale.time(x0) / seconds, scale.value(y0)], [scale.time(x) / seconds, scale.value(y)]);
      const kept = e.shiftKey ? before : {}, own = new Set([...(kept[feature] ?? []), ...found]);
      graph.select({ ...kept, [feature]: [...own].sort((a, b) => a - b) });
    }, (e) => {
      set(this.box, { visibility: "hidden" });
      if (!e) graph.select(before);
      else if (!boxed) {
        graph.select({});
        if (x0 >= LEFT - 4 && x0 <= panel.width - RIGHT + 4) graph.seek(scale.time(x0));
      }
    });
  }

  /** @param {MouseEvent} event */
  add(event) {
    if (/** @type {Element} */ (event.target).closest(".point, .handle")) return;
    const { graph, panel } = this, { scale, feature } = panel, [x, y] = this.at(event);
    const time = graph.share(scale.time(x), event.ctrlKey), on = valueAt(panel.keys, time);
    const value = Math.abs(scale.y(on) - y) < NEAR_PX ? undefined : scale.value(y);
    graph.store.commit((now) => edits.add(now, feature, time, value), { at: event.timeStamp });
    const i = panel.keys.findIndex((key) => Math.abs(key.time - time) < 1e-6);
    if (i >= 0) graph.select({ [feature]: [i] });
  }

  /** Time about the pointer, also for a pinch on a touchpad, which comes as Ctrl; with Shift sideways, with Alt the values. @param {WheelEvent} event */
  wheel(event) {
    event.preventDefault();
    const { graph, panel } = this, { scale, feature } = panel, [x, y] = this.at(event);
    const factor = Math.exp(0.0015 * (event.deltaY || event.deltaX));
    if (event.shiftKey) {
      const by = 0.001 * (event.deltaY || event.deltaX) * (scale.times[1] - scale.times[0]);
      graph.zoom([scale.times[0] + by, scale.times[1] + by]);
    } else if (event.altKey) {
      graph.values[feature] = zoomed(scale.values, scale.value(y), factor);
      graph.draw();
    } else graph.zoom(zoomed(scale.times, scale.time(x), factor));
  }

  /** @param {KeyboardEvent} event @param {number} i */
  key(event, i) {
    const { graph, panel } = this, { store } = graph;
    const up = { ArrowUp: 1, ArrowDown: -1, PageUp: 10, PageDown: -10 }[event.key];
    const turn = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (event.ctrlKey || event.metaKey || (up === undefined && turn === undefined)) return;
    event.preventDefault();
    if (!this.chosen.includes(i)) graph.select({ [panel.feature]: [i] });
    const how = { at: event.timeStamp, tag: `${event.altKey} ${panel.feature} ${this.chosen} ${event.key}` };
    if (up !== undefined) {
      const by = up * panel.kind.step * (event.shiftKey ? 5 : 1);
      store.commit((now) => selection.move(now, graph.chosen, 0, { [panel.feature]: by }), how);
    } else if (turn !== undefined && event.altKey) {
      const by = (turn * graph.model.controlDt) / duration(store.now);
      store.commit((now) => selection.move(now, graph.chosen, by, {}), how);
    } else if (turn !== undefined) {
      const next = Math.min(Math.max(i + turn, 0), panel.points.length - 1);
      graph.select({ [panel.feature]: [next] });
      panel.points[next].focus();
    }
  }

  /** A frame with handles around two keys or more. @param {number[]} chosen */
  drawFrame(chosen) {
    const { panel } = this, { scale, keys } = panel, seconds = duration(this.graph.store.now);
    const xs = chosen.map((i) => scale.x(keys[i].time * seconds)), ys = chosen.map((i) => scale.y(keys[i].value));
    const [x, y, right, bottom] = [Math.min(...xs) - 9, Math.min(...ys) - 9, Math.max(...xs) + 9, Math.max(...ys) + 9];
    const visibility = chosen.length > 1 ? "visible" : "hidden";
    set(this.frame, chosen.length > 1 ? { x, y, width: right - x, height: bottom - y, visibility } : { visibility });
    if (chosen.length < 2) return this.handles.forEach((handle) => set(handle, { visibility }));
    const middle = [(x + right) / 2 - 4, (y + bottom) / 2 - 4];
    const places = [[x - 4, middle[1]], [right - 4, middle[1]], [middle[0], y - 4], [middle[0], bottom - 4]];
    this.handles.forEach((handle, side) => {
      const [hx, hy] = places[side], flat = side > 1 && bottom - y < 20;
      set(handle, { x: hx, y: hy, visibility: flat ? "hidden" : "visible" });
    });
  }
}
