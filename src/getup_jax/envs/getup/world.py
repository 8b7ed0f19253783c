"""What all episodes of the get-up task share."""

from __future__ import annotations

import jax
from flax import struct

from getup_jax.envs.getup.resets.pool import Pool
from getup_jax.physics.terrain import Ground
from getup_jax.pose_prior.prior import PosePrior


@struct.dataclass
class World:
    """Every array that the task reads and training does not change."""

    prior: PosePrior | None  # None: the action is the pose
    pool: Pool
    terrain: Ground
    points: jax.Array  # [G, 9, 3] control points of the styles
    duration: jax.Array  # [G] s
    neutral_rotation: jax.Array  # [L - 1, 4] joint rotations of the neutral pose
    target_lower: jax.Array  # [J] lowest PD target (rad)
    target_upper: jax.Array  # [J]
