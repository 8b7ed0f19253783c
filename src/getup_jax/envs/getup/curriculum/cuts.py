"""Random ends of training episodes, which come the later the fewer episodes fail before them.

Short episodes put most samples near the frames that episodes start on, where a policy learns to
go on with a motion and not just to stand. Once it can, it must learn what comes later. So the mean
time to a cut follows success: it settles where a tenth of the episodes fail before they are cut.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp

FAILED_SHARE = 0.1  # of the episodes that end, where the time to a cut stays as it is
RATE = 1e-3  # of its logarithm, an ended episode; without a failure it doubles in 7,000


def cut(
    truncated: jax.Array, terminated: jax.Array, chance: jax.Array, key: jax.Array
) -> jax.Array:
    """truncated [B], and a random share `chance` [] of those that go on."""
    drawn = jax.random.uniform(key, truncated.shape) < chance
    return truncated | (drawn & ~terminated)


def followed(
    mean_s: jax.Array,
    terminated: jax.Array,
    truncated: jax.Array,
    least_s: float,
    most_s: float,
) -> jax.Array:
    """The mean time to a cut [] after a step whose episodes [B] failed or were cut.

    log t += RATE (FAILED_SHARE n_ended - n_failed), between least_s and most_s.
    """
    failed = jnp.sum(terminated)
    ended = failed + jnp.sum(truncated & ~terminated)
    change = jnp.exp(RATE * (FAILED_SHARE * ended - failed))
    return jnp.clip(mean_s * change, least_s, most_s)
