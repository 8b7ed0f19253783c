"""Incremental learning: a new policy weights a trained one's actions and adds to them [C 5].

    a ~ N(mu + w stop(a_meta), sigma^2),    a_meta ~ meta policy        (equation 10)

The meta action is the last part of the observation, so that rollout, samples and updates know it
without a field of their own. A meta policy may have one itself: the chain's deepest comes first.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
from flax import struct

from getup_jax.core import device_axis
from getup_jax.core.types import Kinematics, StepOutput
from getup_jax.envs.composite.meta.observation_substitution import Substitution, substitute
from getup_jax.envs.composite.reference_windows import References
from getup_jax.envs.composite.task import CompositeState, CompositeTask, CompositeWorld
from getup_jax.networks import gaussian
from getup_jax.rl.actor_critic import ActorCritic, normalized
from getup_jax.rl.state import PolicyState


@dataclasses.dataclass(frozen=True, eq=False)
class Level:
    """One trained policy of the chain."""

    model: ActorCritic
    columns: tuple[int, ...]  # what it sees of the observation
    noise: float  # times the std that it gives; 0: it acts with its mean


@struct.dataclass
class LevelArrays:
    """The arrays of one policy of the chain."""

    policy: PolicyState
    scale: jax.Array  # [A] its action 1 in units of the next level's
    shift: jax.Array  # [A] its action 0 in them
    sees: Substitution | None = None  # how it sees the links that it has lost; None: as they are


@struct.dataclass
class MetaWorld:
    """The task's world, and the chain of trained policies."""

    task: CompositeWorld
    levels: tuple[LevelArrays, ...]

    @property
    def references(self) -> dict[str, References]:
        """The clips of every group."""
        return self.task.references


@struct.dataclass
class MetaState:
    """B episodes, with the meta action at the end of the observation."""

    task: CompositeState
    observation: jax.Array  # [B, O + A]
    key: jax.Array


@dataclasses.dataclass(frozen=True, eq=False)
class MetaTask:
    """A composite task whose observations end in the action of a meta policy."""

    task: CompositeTask
    levels: tuple[Level, ...]
    sample: bool = True  # meta actions are drawn; False: their means
    new: tuple[bool, ...] = ()  # [A] hinges whose clips the last meta policy was not trained on

    @property
    def frames(self) -> tuple[int, int]:
        """Number and size of the frames that an observation starts with."""
        return self.task.frames

    @property
    def action_size(self) -> int:
        """A."""
        return self.task.action_size

    @property
    def meta_size(self) -> int:
        """Numbers of the meta action."""
        return self.task.action_size

    @property
    def observation_size(self) -> int:
        """O, the meta action included."""
        return self.task.observation_size + self.meta_size

    @property
    def num_objectives(self) -> int:
        """K."""
        return self.task.num_objectives

    def init(self, world: MetaWorld, key: jax.Array, num_envs: int) -> MetaState:
        """B fresh episodes."""
        key_task, key_meta, key_next = jax.random.split(key, 3)
        task = self.task.init(world.task, key_task, num_envs)
        return MetaState(task, self._join(world, task, key_meta), key_next)

    def stagger(self, state: MetaState, key: jax.Array) -> MetaState:
        """Fresh episodes that end at different times."""
        return state.replace(task=self.task.stagger(state.task, key))

    def step(
        self, world: MetaWorld, state: MetaState, action: jax.Array
    ) -> tuple[MetaState, StepOutput]:
        """One control step; episodes that end start anew."""
        return self._after(world, state, *self.task.step(world.task, state.task, action))

    def advance(
        self, world: MetaWorld, state: MetaState, action: jax.Array
    ) -> tuple[MetaState, StepOutput]:
        """One control step without resets."""
        return self._after(world, state, *self.task.advance(world.task, state.task, action))

    def kinematics(self, state: MetaState) -> Kinematics:
        """What can be seen of the simulations."""
        return self.task.kinematics(state.task)

    def adopt(
        self, world: MetaWorld, state: CompositeState, goals: Any, key: jax.Array
    ) -> MetaState:
        """See `CompositeTask.adopt`."""
        task = self.task.adopt(world.task, state, goals, key)
        return MetaState(task, self._join(world, task, key), key)

    def task_state(self, state: MetaState) -> CompositeState:
        """The episode as a task without a meta policy has it."""
        return state.task

    def goal_states(self, state: MetaState) -> Any:
        """See `CompositeTask.goal_states`."""
        return self.task.goal_states(state.task)

    def success(self, state: MetaState) -> dict[str, jax.Array]:
        """See `CompositeTask.success`."""
        return self.task.success(state.task)

    def _after(
        self, world: MetaWorld, state: MetaState, task: CompositeState, output: StepOutput
    ) -> tuple[MetaState, StepOutput]:
        key_next, key_meta = jax.random.split(state.key)
        joined = self._join(world, task, device_axis.own_key(key_meta))
        # only critics look at it, and they do not see the meta action
        none = jnp.zeros_like(joined[:, self.task.observation_size :])
        final = jnp.concatenate([output.final_observation, none], axis=-1)
        output = output.replace(observation=joined, final_observation=final)
        return MetaState(task, joined, key_next), output

    def _join(self, world: MetaWorld, task: CompositeState, key: jax.Array) -> jax.Array:
        action = self.meta_action(world, self._observations(world, task), key)
        return jnp.concatenate([task.observation, action], axis=-1)

    def _observations(self, world: MetaWorld, task: CompositeState) -> list[jax.Array]:
        """What every level sees, [B, O] each; a policy's own loss hides from those before it."""
        found, history = [], task.history
        observation = task.observation
        for arrays in reversed(world.levels):
            if arrays.sees is not None:
                history = substitute(arrays.sees, history)
                observation = self.task.observe(history, task.goals, task.physics)
            found.append(observation)
        return found[::-1]

    def meta_action(
        self, world: MetaWorld, observations: list[jax.Array], key: jax.Array
    ) -> jax.Array:
        """The chain's action [B, A] in this task's units; an observation [B, O] a level."""
        action = jnp.zeros((len(observations[0]), 0), observations[0].dtype)
        levels = zip(self.levels, world.levels, observations, strict=True)
        for index, (level, arrays, observation) in enumerate(levels):
            seen = jnp.concatenate([observation[:, jnp.asarray(level.columns)], action], axis=-1)
            seen = normalized(arrays.policy, seen)
            noise = jnp.full(self.action_size, level.noise)
            mean, std = level.model.distribution(arrays.policy.actor, seen, noise)
            if self.sample and level.noise:
                mean = gaussian.sample(jax.random.fold_in(key, index), mean, std)
            action = arrays.scale * mean + arrays.shift
        return action
