"""The state of a training run, as one pytree that starts, ends and resumes an iteration."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
from flax import struct

from getup_jax.algo.discriminator import DiscriminatorState
from getup_jax.algo.normalize import Moments
from getup_jax.algo.popart import PopArt


@struct.dataclass
class PolicyState:
    """What acting needs, and nothing else: the light part of a checkpoint."""

    actor: Any  # variables of the actor network
    statistics: Moments | None  # [O] of the observations; None: not normalised


@struct.dataclass
class LearnerState:
    """What a checkpoint keeps of the learner."""

    policy: PolicyState
    critic: Any  # variables of the critic network
    optimiser: Any  # optax state over the actor and the critic together
    popart: PopArt | None  # [K]; None: targets in return units
    learning_rate_scale: jax.Array  # [] float32, times the scheduled rate
    # by motion group; None: no composite motion
    discriminators: dict[str, DiscriminatorState] | None = None


@struct.dataclass
class TrainState:
    """All that one iteration hands to the next."""

    learner: LearnerState
    environment: Any  # of B simulations
    key: jax.Array  # never changes: iterations fold their number into it
    iteration: jax.Array  # [] int32, iterations done


def owned(state: Any) -> Any:
    """A copy whose arrays are strongly typed and share no memory with each other or with `world`.

    A weakly typed leaf would compile the second iteration anew, and a shared buffer cannot be
    donated.
    """
    return jax.tree.map(lambda x: jnp.array(x, dtype=jnp.asarray(x).dtype, copy=True), state)
