"""The state of a training run, as one pytree that starts, ends and resumes an iteration."""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
from flax import struct

from getup_jax.rl.discriminator import DiscriminatorState
from getup_jax.rl.normalize import Moments
from getup_jax.rl.popart import PopArt


@struct.dataclass
class PolicyState:
    """What acting needs, and nothing else: the light part of a checkpoint."""

    actor: Any  # variables of the actor network
    statistics: Moments | None  # [O] of the observations; None: not normalised


@struct.dataclass
class Valuation:
    """What values need; with a policy that goes on training, its critic need not begin anew."""

    critic: Any  # variables of the critic network
    popart: PopArt | None  # [K]; None: targets in return units


@struct.dataclass
class LearnerState:
    """What a checkpoint keeps of the learner."""

    policy: PolicyState
    critic: Any  # variables of the critic network
    average: Any  # moving average of the actor's variables: what is evaluated and exported
    actor_optimiser: Any  # optax state
    critic_optimiser: Any  # optax state
    popart: PopArt | None  # [K]; None: targets in return units
    learning_rate_scale: jax.Array  # [] float32, times the actor's scheduled rate
    # by motion group; None: no composite motion
    discriminators: dict[str, DiscriminatorState] | None = None

    @property
    def averaged_policy(self) -> PolicyState:
        """The policy to evaluate and export: the averaged actor, the newest statistics."""
        return dataclasses.replace(self.policy, actor=self.average)

    @property
    def valuation(self) -> Valuation:
        """What an exported policy keeps of the critic."""
        return Valuation(self.critic, self.popart)

    def beginning_with(self, policy: PolicyState, valuation: Valuation) -> LearnerState:
        """The learner with another policy, which so far is its own average, and its critic."""
        return dataclasses.replace(
            self,
            policy=policy,
            average=policy.actor,
            critic=valuation.critic,
            popart=valuation.popart,
        )


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
