"""The ground: one interface for its height, flat for now."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from flax import struct


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
