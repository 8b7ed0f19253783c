"""A moving average of the actor's weights, which is what is evaluated and exported.

Single iterations wander around what they have learned; their average does not (Polyak and Juditsky
1992). Early weights must not stay in it, so that its window is a share of the run so far until it
is as long as a run's end needs (Shamir and Zhang 2013, polynomial-decay averaging).
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

WINDOW_SHARE = 0.1  # of the updates so far, at most


def update(average: Any, actor: Any, updates: jax.Array, samples: int, window: float) -> Any:
    """The average after another iteration.

        fraction = max(samples / window, 1 / (1 + WINDOW_SHARE * updates)), at most 1
        average  = average + fraction * (actor - average)

    Args:
        average: variables of the actor.
        actor: the newest ones.
        updates: [] iterations that changed the actor before this one; after none, the average is
            the actor itself.
        samples: of an iteration.
        window: samples, `ppo.average_steps`; 0: no average, but the actor itself.
    """
    if window == 0:
        return actor
    young = 1.0 / (1.0 + WINDOW_SHARE * updates.astype(jnp.float32))
    fraction = jnp.clip(jnp.maximum(samples / window, young), 0.0, 1.0)
    return jax.tree.map(lambda old, new: old + fraction * (new - old), average, actor)
