"""The flat plane as a place where bodies lie; see `terrain_map.py` for irregular ground."""

from __future__ import annotations

import dataclasses

import numpy as np

from getup_jax.physics.terrain import HeightField


@dataclasses.dataclass(frozen=True)
class Plane:
    """The ground at z = 0: one region, in which every body starts at the origin."""

    def field(self) -> HeightField:
        """The plane in NumPy, of two triangles that go on beyond their edges."""
        return HeightField.of(np.zeros((2, 2)), np.zeros(2), 1.0)

    def region(self, xy: np.ndarray) -> np.ndarray:
        """The region [...] of places xy [..., 2] (m): the first one, the flat."""
        return np.zeros(np.shape(xy)[:-1], int)

    def draw_spawn(self, region: int, count: int, rng: np.random.Generator) -> np.ndarray:
        """Where `count` bodies start, [count, 2]: at the origin, as the plane is even."""
        return np.zeros((count, 2))
