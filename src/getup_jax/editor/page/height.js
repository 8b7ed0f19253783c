// Heights of a piece of irregular ground.

/** The height (m) at the nearest point of the grid. @param {import("./types.js").Ground} ground @param {number} x @param {number} y */
export function heightAt({ origin, step, points, heights }, x, y) {
  const clamp = (/** @type {number} */ v) => Math.min(Math.max(Math.round(v), 0), points - 1);
  return heights[clamp((y - origin[1]) / step) * points + clamp((x - origin[0]) / step)];
}
