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
class Judgement:
    """What a discriminator has learned, without its optimiser."""

    variables: Any
    statistics: Moments  # [D] of the frames


@struct.dataclass
class Valuation:
    """What rewards and values need: with it, a policy that goes on training is valued as before.

    Discriminators that begin anew see through every motion, or through none, for a while.
    """

    critic: Any  # variables of the critic network
    popart: PopArt | None  # [K]; None: targets in return units
    discriminators: dict[str, Judgement] | None = None  # by motion group


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
        """What an exported policy keeps of critic and discriminators."""
        judgements = None
        if self.discriminators is not None:
            judgements = {
                name: Judgement(state.variables, state.statistics)
                for name, state in self.discriminators.items()
            }
        return Valuation(self.critic, self.popart, judgements)

    def beginning_with(self, policy: PolicyState, valuation: Valuation) -> LearnerState:
        """The learner with another policy, which so far is its own average, and what values it."""
        states, learned = self.discriminators, valuation.discriminators
        if states and learned:
            states = {
                name: dataclasses.replace(
                    state, variables=learned[name].variables, statistics=learned[name].statistics
                )
                for name, state in states.items()
            }
        return dataclasses.replace(
            self,
            policy=policy,
            average=policy.actor,
            critic=valuation.critic,
            popart=valuation.popart,
            discriminators=states,
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
