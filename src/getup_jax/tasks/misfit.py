"""How badly the lying starts on irregular ground fit the beginning of their curves.

A rag-doll may lie 30 degrees off a curve [P 5.2], and with the head below the feet also far below
it. Such a start has seconds to catch up with the curve before its reward ends it, and with even
draws most samples come from those that have not. `focus.py` follows their success apart.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp

from getup_jax.physics.terrain import Ground
from getup_jax.tasks import rewards
from getup_jax.tasks.episode import LYING
from getup_jax.tasks.observation import Observer
from getup_jax.tasks.reset_pool import Pool

CLASSES = 4


def classes(pool: Pool, observer: Observer, ground: Ground, points: jax.Array) -> jax.Array:
    """Class [P] int32 of every start of the pool: 0 (it fits) to CLASSES - 1.

        class = floor(CLASSES (1 - r_h r_theta))

    with the rewards of equations 5 and 6 for the state at rest and its style's first control point,
    points [G, 9, 3]. Starts on the flat, standing or along the curve are in class 0.
    """
    rows = pool.table[LYING, 1:]  # [R - 1, G, M]
    value = observer.posture(pool.physics.kinematics, ground).features[rows]
    target = points[:, None, 0]
    reward = rewards.height(value[..., 0], target[..., 0])
    reward *= rewards.orientation(value[..., 1:], target[..., 1:])
    found = jnp.minimum(jnp.floor(CLASSES * (1.0 - reward)), CLASSES - 1).astype(jnp.int32)
    return jnp.zeros(len(pool.time), jnp.int32).at[rows].set(found)
