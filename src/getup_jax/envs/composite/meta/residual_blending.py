"""How the hinges with new clips are handed over from a meta policy to the one that is trained.

Where both arms do something else, a walk falls within seconds even if it does not see them
(familiar.py): they throw it off its balance. While episodes end so soon, nobody learns to stay
upright with them. So the meta policy keeps a share of their targets, which falls with success.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp

FALL_S = 4.0  # mean time to a fall where the share stays as it is
WHOLE_S = 12_800.0  # simulated time, of all episodes together, in which it falls by 1 without falls


def blended(share: jax.Array, new: jax.Array, own: jax.Array, meta: jax.Array) -> jax.Array:
    """Actions [B, A]: the own ones [B, A], and a share [] of the meta policy's where new [A]."""
    return jnp.where(new, (1.0 - share) * own + share * meta, own)


def followed(share: jax.Array, fell: jax.Array, step_s: float, first: float) -> jax.Array:
    """The share [] after a step of step_s seconds in which the episodes [B] fell or did not.

    share += (FALL_S n_fell - step_s B) / WHOLE_S, between 0 and the first one.
    """
    change = (FALL_S * jnp.sum(fell) - step_s * fell.size) / WHOLE_S
    return jnp.clip(share + change, 0.0, first)
