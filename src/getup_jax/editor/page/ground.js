// The ground: a plane or a piece of a height field, with a line every metre.

import {
  BufferAttribute, BufferGeometry, DoubleSide, LineBasicMaterial, LineSegments, Mesh, MeshLambertMaterial, PlaneGeometry,
} from "./vendor/three.min.js";

/** @import { Ground } from "./types.js" */

const HALF_M = 20; // the lines of a plane reach this far
const LIFT_M = 0.004; // of lines above the ground

/** Meshes of the ground. @param {Ground | null} ground null: a plane @param {{ floor: string, line: string }} colours @returns {any[]} */
export function makeGround(ground, colours) {
  const material = new MeshLambertMaterial({ color: colours.floor, side: DoubleSide, flatShading: Boolean(ground) });
  Object.assign(material, { polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 4 }); // the lines lie on it
  const floor = new Mesh(ground ? landscape(ground) : new PlaneGeometry(80, 80), material);
  floor.receiveShadow = true;
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(ground ? raised(ground) : flat()), 3));
  return [floor, new LineSegments(geometry, new LineBasicMaterial({ color: colours.line }))];
}

// In pieces: some renderers drop lines that reach behind the camera.
function flat() {
  const ends = [], z = LIFT_M;
  for (let i = -HALF_M; i <= HALF_M; i++) {
    for (let j = -HALF_M; j < HALF_M; j++) ends.push(i, j, z, i, j + 1, z, j, i, z, j + 1, i, z);
  }
  return ends;
}

/** Along the edges of the triangles, so that the lines show what rises and falls. @param {Ground} ground */
function raised({ origin, step, points, heights }) {
  const every = Math.max(1, Math.round(1 / step)), ends = [];
  const corner = (/** @type {number} */ row, /** @type {number} */ column) => [origin[0] + column * step, origin[1] + row * step, heights[row * points + column] + LIFT_M];
  for (let i = 0; i < points; i += every) {
    for (let j = 0; j + 1 < points; j++) ends.push(...corner(i, j), ...corner(i, j + 1), ...corner(j, i), ...corner(j + 1, i));
  }
  return ends;
}

/** Height field triangles as MuJoCo cuts the cells: from the lower to the upper corner in x and y. @param {Ground} ground */
function landscape({ origin, step, points, heights }) {
  const position = new Float32Array(points * points * 3);
  const index = [];
  for (let row = 0; row < points; row++) {
    for (let column = 0; column < points; column++) {
      const i = row * points + column;
      position.set([origin[0] + column * step, origin[1] + row * step, heights[i]], 3 * i);
      if (row + 1 < points && column + 1 < points) index.push(i, i + 1, i + points + 1, i, i + points + 1, i + points);
    }
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(position, 3));
  geometry.setIndex(index);
  geometry.computeVertexNormals();
  return geometry;
}
