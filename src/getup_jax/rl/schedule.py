"""Settings that change over the run in equal stages."""

from __future__ import annotations

import jax
import jax.numpy as jnp

# Progress is a rounded float32, and must not miss a stage by its last bit.
_ROUNDING = 1e-5


def value(first: float, last: float, stages: int, progress: jax.Array) -> jax.Array:
    """The setting at `progress` (0 to 1 of the run), as a float32 scalar.

    stage = min(floor(progress * stages), stages - 1), and the stages are spaced evenly from first
    to last: from 1e-4 to 2e-5 in five stages is 1e-4, 8e-5, 6e-5, 4e-5, 2e-5 (Frezzato et al. 2022,
    section 5.6). One stage is `first` throughout; past the end the last stage goes on.
    """
    if stages == 1:
        return jnp.full_like(progress, first)
    stage = jnp.clip(jnp.floor(progress * stages + _ROUNDING), 0, stages - 1)
    share = stage / (stages - 1)
    return first + (last - first) * share
