"""How far the lying starts on irregular ground are below the beginning of their curves.

A rag-doll may come to rest with its head down the slope: then its neck is below the curve, and it
has to rise over feet that lie higher. `start_prioritisation.py` follows such starts apart: a policy
that gets up from three in four of the others gets up from one in five of them.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp

from getup_jax.envs.getup.episode import LYING
from getup_jax.envs.getup.observation import Observer
from getup_jax.envs.getup.resets.pool import Pool
from getup_jax.physics.terrain import Ground

CLASSES = 4
_WIDTH_M = 0.06


def classes(pool: Pool, observer: Observer, ground: Ground, points: jax.Array) -> jax.Array:
    """Class [P] int32 of every start of the pool: 0 (it fits) to CLASSES - 1.

        class = clip(floor((p_h - h) / .06 m), 0, CLASSES - 1)

    with the height h of the state at rest and p_h of its style's first control point, points
    [G, 9, 3]. Starts on the flat, standing or along the curve are in class 0.
    """
    rows = pool.table[LYING, 1:]  # [R - 1, G, M]
    height = observer.posture(pool.physics.kinematics, ground).features[rows, 0]
    below = points[:, None, 0, 0] - height
    found = jnp.clip(jnp.floor(below / _WIDTH_M), 0, CLASSES - 1).astype(jnp.int32)
    return jnp.zeros(len(pool.time), jnp.int32).at[rows].set(found)
