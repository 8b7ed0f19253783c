// The character as three.js meshes: a group a link, posed by positions and quaternions.

import { BoxGeometry, CapsuleGeometry, Color, Group, Mesh, MeshLambertMaterial, SphereGeometry } from "./vendor/three.min.js";

/** @import { Shape } from "./types.js" */

export const TINTS = ["#3f74b5", "#b8862b", "#8a55ad", "#2f8f6b", "#c0392b"]; // of the variants, and of the source
export const SOURCE = 4; // the tint of a clip's own motion

export class Body {
  /** @param {Shape[]} shapes @param {number} links how many */
  constructor(shapes, links) {
    this.group = new Group();
    this.links = Array.from({ length: links }, () => new Group());
    this.group.add(...this.links);
    /** @type {string | null} what it shows */
    this.shown = null;
    /** @type {any[]} */
    this.materials = [];
    for (const shape of shapes) this.links[shape.link].add(this.mesh(shape));
  }

  /** @param {Shape} shape */
  mesh(shape) {
    const material = new MeshLambertMaterial({ color: new Color(...shape.colour).convertSRGBToLinear() });
    material.userData.own = material.color.clone();
    this.materials.push(material);
    const mesh = new Mesh(geometry(shape), material);
    mesh.position.set(...shape.position);
    const [w, x, y, z] = shape.quaternion;
    mesh.quaternion.set(x, y, z, w);
    mesh.castShadow = true;
    return mesh;
  }

  /** A ghost is see-through and in the tint of its variant. @param {boolean} ghost @param {number} slot */
  dress(ghost, slot) {
    for (const material of this.materials) {
      material.needsUpdate = material.transparent !== ghost; // another shader
      material.transparent = ghost;
      material.opacity = ghost ? 0.4 : 1;
      material.polygonOffset = ghost; // behind the solid body where both are at one place
      material.polygonOffsetFactor = 2;
      material.polygonOffsetUnits = 8;
      if (ghost) material.color.set(TINTS[slot]);
      else material.color.copy(material.userData.own);
    }
    for (const link of this.links) for (const mesh of link.children) mesh.castShadow = !ghost;
  }

  /** @param {Float32Array} values seven numbers a link */
  pose(values) {
    this.links.forEach((link, i) => {
      const [x, y, z, qw, qx, qy, qz] = values.subarray(7 * i, 7 * i + 7);
      link.position.set(x, y, z);
      link.quaternion.set(qx, qy, qz, qw);
    });
  }
}

// All bodies share them: a key is a shape's kind and size.
const known = new Map();

/** @param {Shape} shape */
function geometry({ kind, size }) {
  const key = `${kind} ${size}`;
  if (!known.has(key)) known.set(key, made(kind, size));
  return known.get(key);
}

/** As few triangles as still look round: a renderer without a GPU pays for each of them. @param {string} kind @param {number[]} size */
function made(kind, size) {
  if (kind === "sphere") return new SphereGeometry(size[0], 18, 12);
  if (kind === "box") return new BoxGeometry(2 * size[0], 2 * size[1], 2 * size[2]);
  return new CapsuleGeometry(size[0], 2 * size[1], 5, 14).rotateX(Math.PI / 2); // MuJoCo's lie along z
}
