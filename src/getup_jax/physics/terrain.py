"""The ground as the task sees it: height, normal and clearance at any place, inside jit.

`Terrain` is the flat plane, `HeightField` an irregular ground; a world holds one of them.
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

Array = Any  # jax.Array, or np.ndarray on the host


@struct.dataclass
class Terrain:
    """A flat ground at `level`; a pytree, so that it travels in the world."""

    level: jax.Array  # [] m

    @classmethod
    def flat(cls) -> Terrain:
        """The ground at z = 0."""
        return cls(level=jnp.zeros((), jnp.float32))

    def height(self, xy: jax.Array) -> jax.Array:
        """Ground height [...] (m) at positions xy [..., 2] (m)."""
        return jnp.broadcast_to(self.level, xy.shape[:-1])

    def normal(self, xy: jax.Array) -> jax.Array:
        """Unit normal [..., 3] of the ground at xy [..., 2] (m)."""
        return jnp.broadcast_to(jnp.array([0.0, 0.0, 1.0]), (*xy.shape[:-1], 3))

    def clearance(self, centre: jax.Array, radius: jax.Array | float) -> jax.Array:
        """Gap [...] (m) between the ground and spheres around centre [..., 3] (m)."""
        return centre[..., 2] - radius - self.height(centre[..., :2])


@struct.dataclass
class HeightField:
    """Ground over a regular grid of heights, triangulated as MuJoCo collides with it.

    MuJoCo splits every cell along the diagonal from its lower to its upper corner in x and y. Over
    one triangle the height is a + p u + q v, where u and v in [0, 1] are the place in the cell and
    a is the height of its lower corner. Beyond the field's edge the height of the edge goes on.

    The functions take JAX arrays, inside jit or not, and NumPy arrays for work on the host.
    """

    planes: Array  # [2 (ny - 1) (nx - 1), 3] a, p, q (m), both triangles of a cell in turn
    size: Array  # [2] int32 cells along x and y
    origin: Array  # [2] x and y of the grid's first point (m)
    step: Array  # [] m between two points

    @classmethod
    def of(cls, heights: np.ndarray, origin: np.ndarray, step: float) -> HeightField:
        """The field of heights [ny, nx] (m), in NumPy; the first is at `origin` [2] (m)."""
        z = np.asarray(heights, np.float64)
        a, b, c, d = z[:-1, :-1], z[:-1, 1:], z[1:, :-1], z[1:, 1:]
        right = np.stack([a, b - a, d - b], axis=-1)  # u > v
        left = np.stack([a, d - c, c - a], axis=-1)
        return cls(
            planes=np.stack([right, left], axis=2).reshape(-1, 3).astype(np.float32),
            size=np.array([z.shape[1] - 1, z.shape[0] - 1], np.int32),
            origin=np.asarray(origin, np.float32),
            step=np.asarray(step, np.float32),
        )

    def height(self, xy: Array) -> Array:
        """Ground height [...] (m) at positions xy [..., 2] (m)."""
        plane, place = self._triangle(xy)
        return plane[..., 0] + (plane[..., 1:] * place).sum(axis=-1)

    def normal(self, xy: Array) -> Array:
        """Unit normal [..., 3] of the triangle at xy [..., 2] (m)."""
        return self._unit_normal(self._triangle(xy)[0])

    def clearance(self, centre: Array, radius: Array | float) -> Array:
        """Gap [...] (m) between spheres around centre [..., 3] (m) and the triangles below them."""
        plane, place = self._triangle(centre[..., :2])
        above = centre[..., 2] - plane[..., 0] - (plane[..., 1:] * place).sum(axis=-1)
        return above * self._unit_normal(plane)[..., 2] - radius

    def _triangle(self, xy: Array) -> tuple[Array, Array]:
        """The plane [..., 3] of the triangle at xy, and the place (u, v) [..., 2] in its cell."""
        xp = _namespace(xy)
        grid = (xy - self.origin) / self.step
        cell = xp.clip(xp.floor(grid).astype(xp.int32), 0, self.size - 1)
        place = xp.clip(grid - cell, 0.0, 1.0)
        left = (place[..., 1] >= place[..., 0]).astype(xp.int32)
        index = 2 * (cell[..., 1] * self.size[0] + cell[..., 0]) + left
        return xp.asarray(self.planes)[index], place

    def _unit_normal(self, plane: Array) -> Array:
        xp = _namespace(plane)
        slope = plane[..., 1:] / self.step
        normal = xp.concatenate([-slope, xp.ones_like(slope[..., :1])], axis=-1)
        return normal / xp.linalg.norm(normal, axis=-1, keepdims=True)


Ground = Terrain | HeightField


def _namespace(x: Array) -> Any:
    return jnp if isinstance(x, jax.Array) else np
