// The controls below the curves and in the header; they change the store and follow it.

import { FEATURES, shifted } from "./spline.js";

const LIES = ["prone", "supine", "side"];

export class Controls {
  constructor(elements, store, onBand) {
    Object.assign(this, { elements, store, imported: [] });
    const { curve, band, start, region, place, duration, seconds, shift, name } = elements;
    curve.addEventListener("change", () => this.choose(curve.value));
    band.addEventListener("change", onBand);
    start.addEventListener("change", () => this.startFrom(start.value));
    region.addEventListener("change", () => store.commit((v) => { v.region = Number(region.value); }));
    place.addEventListener("change", () => store.commit((v) => {
      v.place = Math.min(Math.max(Math.round(place.value) || 1, 1), this.scene.terrain.places) - 1;
    }));
    duration.addEventListener("input", () => this.last(Number(duration.value), false));
    duration.addEventListener("change", () => store.commit());
    seconds.addEventListener("change", () => this.last(Number(seconds.value), true));
    shift.addEventListener("input", () => this.shift(Number(shift.value)));
    shift.addEventListener("change", () => this.endShift());
    name.addEventListener("change", () => store.commit((v) => { v.curve.name = name.value.trim() || "my_rise"; }));
    elements.undo.addEventListener("click", () => store.undo());
    elements.redo.addEventListener("click", () => store.redo());
    elements.reset.addEventListener("click", () => store.commit((v) => { v.curve = structuredClone(v.reference); }));
    elements.mirror.addEventListener("click", () => this.mirror());
  }

  // The library, the starts and the guides that the server knows.
  fill(scene) {
    this.scene = scene;
    this.fillCurves();
    const { band, start, region, place } = this.elements;
    band.replaceChildren(option("", "none"), ...Object.entries(scene.bands).map(([name, { count }]) => option(name, `${name} (${count})`)));
    start.replaceChildren(...LIES.map((lies) => {
      const names = scene.starts.filter((s) => s.lies === lies).map((s) => s.name);
      const all = scene.mirrored === null ? names : names.flatMap((n) => [n, scene.mirrored + n]);
      return group(lies, all.map((n) => option(n, n)));
    }).filter((g) => g.children.length));
    region.replaceChildren(...(scene.terrain?.regions ?? ["flat"]).map((name, i) => option(i, name)));
    region.disabled = scene.terrain === null;
    region.title = scene.terrain ? "Where it gets up" : "This policy was trained on flat ground only";
    place.disabled = scene.terrain === null;
    place.max = scene.terrain?.places ?? 1;
  }

  fillCurves() {
    const { starts, curves } = this.scene;
    const references = new Map(starts.map((s) => [s.name, s.lies]));
    const of = (lies) => curves.flatMap((c, i) => (references.get(c.name) === lies ? [option(`c${i}`, c.name)] : []));
    const drawn = curves.flatMap((c, i) => (references.has(c.name) ? [] : [option(`c${i}`, c.name)]));
    const own = this.imported.map((c, i) => option(`i${i}`, c.name));
    const groups = [...LIES.map((lies) => group(lies, of(lies))), group("drawn", drawn), group("imported", own)];
    this.elements.curve.replaceChildren(option("", "choose …"), ...groups.filter((g) => g.children.length));
  }

  addImported(curves) {
    this.imported.push(...curves);
    this.fillCurves();
  }

  choose(value) {
    const list = value[0] === "c" ? this.scene.curves : this.imported;
    const curve = list[Number(value.slice(1))];
    if (curve) this.store.choose(curve);
  }

  // The first points follow the new start pose, since curve and pose must fit.
  startFrom(name) {
    const plain = this.scene.mirrored && name.startsWith(this.scene.mirrored) ? name.slice(this.scene.mirrored.length) : name;
    const first = [...this.scene.starts.find((s) => s.name === plain).first];
    if (plain !== name) first[1] = 180 - first[1];
    this.store.commit(({ curve }) => {
      curve.start = name;
      delete curve.pose;
      FEATURES.forEach((feature, i) => { curve[feature][0] = first[i]; });
    });
  }

  last(value, done) {
    const [low, high] = this.scene.limits.duration;
    const change = (v) => { v.curve.durations = [Math.min(Math.max(Number(value.toFixed(2)) || low, low), high)]; };
    if (done) this.store.commit(change);
    else this.store.live(change);
  }

  shift(amount) {
    this.base ??= structuredClone(this.store.curve);
    this.store.live(({ curve }) => {
      FEATURES.forEach((feature, i) => {
        curve[feature] = shifted(this.base[feature], amount).map((v) => Number(v.toFixed(i ? 1 : 3)));
      });
    });
  }

  endShift() {
    this.base = null;
    this.elements.shift.value = 0;
    this.store.commit();
  }

  mirror() {
    const { mirrored, mirror } = this.scene;
    this.store.commit(({ curve }) => {
      curve.side_angle = curve.side_angle.map((v) => Number((180 - v).toFixed(3)));
      if (curve.pose) curve.pose = mirrorPose(curve.pose, mirror);
      else if (mirrored === null) return; // on irregular ground the places are what they are
      else curve.start = curve.start.startsWith(mirrored) ? curve.start.slice(mirrored.length) : mirrored + curve.start;
    });
  }

  // Shows the store.
  show() {
    const { elements, store } = this;
    const { curve, region, place } = store.current;
    const [seconds] = curve.durations;
    if (document.activeElement !== elements.name) elements.name.value = curve.name;
    elements.duration.value = seconds;
    if (document.activeElement !== elements.seconds) elements.seconds.value = seconds;
    this.showStart(curve);
    elements.region.value = region;
    elements.place.value = place + 1;
    elements.undo.disabled = !store.past.length;
    elements.redo.disabled = !store.future.length;
    const chosen = [...elements.curve.options].find((o) => o.textContent === store.current.reference.name);
    elements.curve.value = chosen ? chosen.value : "";
  }

  // A start that the server does not list, a pose of the file's own, is listed as it is.
  showStart(curve) {
    const { start } = this.elements;
    start.querySelector("[data-own]")?.remove();
    if (![...start.options].some((o) => o.value === curve.start) || curve.pose) {
      const own = option(curve.start, `${curve.start} (its own pose)`);
      own.dataset.own = "";
      own.disabled = true;
      start.append(own);
      own.selected = true;
    } else {
      start.value = curve.start;
    }
  }
}

function mirrorPose(pose, { joint, sign }) {
  const root = [1, -1, 1, 1, -1, 1, -1].map((s, i) => s * pose[i]);
  return [...root, ...joint.map((j, i) => sign[i] * pose[7 + j])];
}

function option(value, text) {
  const element = document.createElement("option");
  element.value = value;
  element.textContent = text;
  return element;
}

function group(label, options) {
  const element = document.createElement("optgroup");
  element.label = label;
  element.append(...options);
  return element;
}
