// Three panels with the curves: target, points to drag, achieved, ghosts, the guide's band.

import { FEATURES, POINTS, sample } from "./spline.js";
import { make, set, text } from "./svg.js";

const LEFT = 40, RIGHT = 12, TOP = 22, BOTTOM = 20;
const KINDS = {
  height: { title: "Neck height", unit: "m", low: 0, high: 1.7, step: 0.01, digits: 3, ticks: [0, 0.5, 1, 1.5] },
  side_angle: { title: "Side to up", unit: "°", low: 0, high: 180, step: 1, digits: 1, ticks: [0, 45, 90, 135, 180] },
  front_angle: { title: "Front to up", unit: "°", low: 0, high: 180, step: 1, digits: 1, ticks: [0, 45, 90, 135, 180] },
};
const HINTS = { side_angle: "90 level, 0 on its left, 180 on its right", front_angle: "0 on its back, 90 upright, 180 face down" };

export class Panels {
  // model: { store, motions, time(), span(), controlDt, band() }; onScrub(time)
  constructor(root, model, onScrub) {
    this.model = model;
    this.panels = FEATURES.map((name, index) => new Panel(root, name, index, model, onScrub));
    new ResizeObserver(() => this.draw()).observe(root);
  }

  draw() { for (const panel of this.panels) panel.draw(); }
  drawTime() { for (const panel of this.panels) panel.drawTime(); }
}

class Panel {
  constructor(root, name, index, model, onScrub) {
    Object.assign(this, { name, index, model, kind: KINDS[name] });
    this.box = document.createElement("div");
    this.box.className = "panel";
    this.svg = make("svg", { role: "group", "aria-label": this.kind.title });
    this.back = make("g");
    this.lines = make("g");
    this.now = make("line", { class: "now" });
    this.dots = make("g");
    this.svg.append(this.back, this.lines, this.now, this.dots);
    this.box.append(this.svg);
    root.append(this.box);
    this.points = Array.from({ length: POINTS }, (_, i) => this.makePoint(i));
    this.dots.append(...this.points);
    this.svg.addEventListener("pointerdown", (event) => this.scrub(event, onScrub));
  }

  makePoint(i) {
    const dot = make("circle", { class: "point", r: 6.5, tabindex: 0, role: "slider", "data-point": i });
    dot.addEventListener("pointerdown", (event) => this.drag(event, dot, i));
    dot.addEventListener("keydown", (event) => this.key(event, i));
    return dot;
  }

  get values() { return this.model.store.curve[this.name]; }

  // Past the usual range only where the points need it.
  range() {
    const { low, high } = this.kind;
    const pad = 0.06 * (high - low);
    return [Math.min(low, ...this.values) - pad, Math.max(high, ...this.values) + pad];
  }

  x(time) { return LEFT + (time / this.model.span()) * (this.width - LEFT - RIGHT); }
  y(value) {
    const [low, high] = this.held ?? this.range();
    return TOP + ((high - value) / (high - low)) * (this.height - TOP - BOTTOM);
  }

  set(i, value) {
    const { low, high, digits } = this.kind;
    const limited = Math.min(Math.max(value, low), high);
    this.model.store.live((variant) => { variant.curve[this.name][i] = Number(limited.toFixed(digits)); });
  }

  drag(event, dot, i) {
    if (event.button !== 0) return;
    event.preventDefault();
    event.stopPropagation();
    dot.focus({ preventScroll: true });
    dot.setPointerCapture(event.pointerId);
    dot.classList.add("held");
    this.held = this.range();
    const offset = event.clientY - this.y(this.values[i]);
    const [low, high] = this.held;
    const move = (e) => {
      const share = (e.clientY - offset - TOP) / (this.height - TOP - BOTTOM);
      this.set(i, high - share * (high - low));
    };
    const end = (e) => {
      dot.removeEventListener("pointermove", move);
      dot.removeEventListener("pointerup", end);
      dot.removeEventListener("pointercancel", end);
      dot.classList.remove("held");
      this.held = null;
      this.model.store.commit(undefined, e.timeStamp);
    };
    dot.addEventListener("pointermove", move);
    dot.addEventListener("pointerup", end);
    dot.addEventListener("pointercancel", end);
  }

  key(event, i) {
    const sign = { ArrowUp: 1, ArrowDown: -1, PageUp: 10, PageDown: -10 }[event.key];
    const turn = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (sign !== undefined) {
      event.preventDefault();
      this.set(i, this.values[i] + sign * this.kind.step * (event.shiftKey ? 5 : 1));
      this.model.store.commit(undefined, event.timeStamp);
    } else if (turn !== undefined) {
      event.preventDefault();
      this.points[Math.min(Math.max(i + turn, 0), POINTS - 1)].focus();
    }
  }

  scrub(event, onScrub) {
    if (event.target.classList.contains("point") || event.button !== 0) return;
    const go = (e) => {
      const share = (e.clientX - this.svg.getBoundingClientRect().left - LEFT) / (this.width - LEFT - RIGHT);
      onScrub(Math.min(Math.max(share, 0), 1) * this.model.span());
    };
    this.svg.setPointerCapture(event.pointerId);
    this.svg.addEventListener("pointermove", go);
    this.svg.addEventListener("pointerup", () => this.svg.removeEventListener("pointermove", go), { once: true });
    go(event);
  }

  draw() {
    if (!this.model.store.variants.length) return;
    this.measure();
    this.drawBack();
    this.lines.replaceChildren(...this.drawBand(), ...this.drawLines());
    this.drawPoints();
    this.drawTime();
  }

  measure() {
    const { clientWidth: width, clientHeight: height } = this.box;
    if (width === this.width && height === this.height) return;
    Object.assign(this, { width, height });
    set(this.svg, { viewBox: `0 0 ${width} ${height}` });
  }

  // Grid and words, made anew only where they change: most edits leave them as they are.
  drawBack() {
    const shown = [this.width, this.height, this.model.span(), this.model.store.curve.durations[0], ...(this.held ?? this.range())].join();
    if (shown === this.shown) return;
    this.shown = shown;
    this.back.replaceChildren(...this.backParts());
  }

  backParts() {
    const parts = [];
    for (const tick of this.kind.ticks) {
      parts.push(make("line", { class: "grid", x1: LEFT, x2: this.width - RIGHT, y1: this.y(tick), y2: this.y(tick) }));
      parts.push(text(LEFT - 9, this.y(tick) + 3.5, String(tick), { "text-anchor": "end" }));
    }
    for (let t = 0; t <= this.model.span() + 1e-6; t += 1) {
      parts.push(make("line", { class: "grid", x1: this.x(t), x2: this.x(t), y1: TOP, y2: this.height - BOTTOM }));
      parts.push(text(this.x(t), this.height - 6, `${t}`, { "text-anchor": "middle" }));
    }
    const end = this.x(this.model.store.curve.durations[0]);
    parts.push(make("line", { class: "end", x1: end, x2: end, y1: TOP, y2: this.height - BOTTOM }));
    parts.push(text(end + 4, TOP + 9, "T"));
    const title = text(LEFT, 15, this.kind.title, { class: "title" });
    const unit = make("tspan", { class: "unit" });
    unit.textContent = ` ${this.kind.unit}`;
    title.append(unit);
    parts.push(title, text(this.width - RIGHT, 15, HINTS[this.name] ?? "blue target · orange achieved · time in s", { "text-anchor": "end" }));
    return parts;
  }

  drawBand() {
    const band = this.model.band();
    if (!band) return [];
    const duration = this.model.store.curve.durations[0];
    const at = (i) => this.x((i / (band.mean.length - 1)) * duration);
    const edge = (sign) => band.mean.map((row, i) => `${at(i)},${this.y(row[this.index] + sign * band.deviation[i][this.index])}`);
    const mean = band.mean.map((row, i) => `${at(i)},${this.y(row[this.index])}`);
    return [
      make("polygon", { class: "band", points: [...edge(1), ...edge(-1).reverse()].join(" ") }),
      make("polyline", { class: "mean", points: mean.join(" ") }),
    ];
  }

  drawLines() {
    const { store, motions, controlDt } = this.model;
    const parts = [];
    store.variants.forEach((variant, slot) => {
      if (slot !== store.active) parts.push(...this.achieved(motions[slot], controlDt, `ghost of${slot}`, `ghost of${slot}`));
    });
    const duration = store.curve.durations[0];
    const target = sample(this.values);
    const last = target.length - 1;
    const line = target.map((value, i) => `${this.x((i / last) * duration)},${this.y(value)}`);
    line.push(`${this.x(this.model.span())},${this.y(target[last])}`);
    parts.push(make("polyline", { class: "target", points: line.join(" ") }));
    parts.push(...this.achieved(motions[store.active], controlDt, "achieved", "achieved after"));
    return parts;
  }

  achieved(motion, dt, name, after) {
    if (!motion) return [];
    const values = motion.features[this.index];
    const line = (from, to) => {
      const points = [];
      for (let i = from; i < to; i++) points.push(`${this.x((i + 1) * dt).toFixed(1)},${this.y(values[i]).toFixed(1)}`);
      return points.join(" ");
    };
    const end = Math.min(motion.ended, motion.count);
    const parts = [make("polyline", { class: name, points: line(0, end) })];
    if (end < motion.count) parts.push(make("polyline", { class: after, points: line(Math.max(end - 1, 0), motion.count) }));
    return parts;
  }

  drawPoints() {
    const duration = this.model.store.curve.durations[0];
    this.points.forEach((dot, i) => {
      const value = this.values[i];
      set(dot, {
        cx: this.x((i / (POINTS - 1)) * duration), cy: this.y(value),
        "aria-label": `${this.kind.title}, point ${i + 1} of ${POINTS}`, "aria-valuetext": `${value} ${this.kind.unit}`,
        "aria-valuenow": value, "aria-valuemin": this.kind.low, "aria-valuemax": this.kind.high,
      });
    });
  }

  drawTime() {
    if (!this.width) return;
    const x = this.x(Math.min(this.model.time(), this.model.span()));
    set(this.now, { x1: x, x2: x, y1: TOP, y2: this.height - BOTTOM });
  }
}
