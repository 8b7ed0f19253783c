// What the goals ask for, in the view: places on the floor, arrows with a knob at their tip, balls.

import { CapsuleGeometry, Color, Group, Mesh, MeshLambertMaterial, SphereGeometry, Vector3 } from "./vendor/three.min.js";

/** @typedef {{ position: number[], reach: number[] | null, radius: number, rgba: number[], flat?: boolean }} Marker */

const UP = new Vector3(0, 1, 0), KNOB_M = 0.07, FLAT = 0.02; // height of a disc by its radius
const ball = new SphereGeometry(1, 20, 12), rod = new CapsuleGeometry(1, 1, 2, 10);

export class Markers {
  constructor() {
    this.group = new Group();
    /** @type {any[]} */
    this.shown = [];
  }

  /** @param {Marker[]} markers */
  show(markers) {
    while (this.shown.length < markers.length) this.shown.push(this.part());
    this.shown.forEach((part, i) => this.place(part, markers[i]));
  }

  part() {
    const material = new MeshLambertMaterial({ transparent: true });
    const part = { material, tip: new Mesh(ball, material), rod: new Mesh(rod, material) };
    this.group.add(part.tip, part.rod);
    return part;
  }

  /** @param {any} part @param {Marker | undefined} marker */
  place(part, marker) {
    part.tip.visible = Boolean(marker);
    part.rod.visible = Boolean(marker?.reach);
    if (!marker) return;
    const [red, green, blue, alpha] = marker.rgba, { radius, reach, flat } = marker;
    part.material.color = new Color(red, green, blue);
    part.material.opacity = alpha;
    part.tip.position.set(...tip(marker));
    part.tip.scale.set(...(reach ? [KNOB_M, KNOB_M, KNOB_M] : [radius, radius, flat ? FLAT * radius : radius]));
    if (!reach) return;
    const along = new Vector3(...reach), length = along.length();
    part.rod.position.set(...marker.position.map((p, i) => p + reach[i] / 2));
    part.rod.quaternion.setFromUnitVectors(UP, along.normalize());
    part.rod.scale.set(radius, Math.max(length - radius, 0.01) / 3, radius); // the capsule is 3 long with its caps
  }
}

/** @param {Marker} marker */
export function tip({ position, reach }) { return reach ? position.map((p, i) => p + reach[i]) : position; }
