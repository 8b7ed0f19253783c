"""Probe environments with known answers, after Jones, "Debugging RL, without the agonizing pain".

One environment class, whose world says which probe it is: all of them run in one compiled step.
Every episode shows a random sign and has a fixed number of steps. The reward of a step is

    constant + by_sign * sign + at_last * (last step) - by_action * (action - answer)^2,
    answer = action_mean + action_by_sign * sign
"""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
from flax import struct

from getup_jax.core.types import StepOutput


@struct.dataclass
class ProbeWorld:
    """The numbers of one probe; all float32 scalars but the last two."""

    constant: jax.Array
    by_sign: jax.Array
    at_last: jax.Array
    by_action: jax.Array
    action_mean: jax.Array
    action_by_sign: jax.Array
    shows_step: jax.Array  # 1: the step's number is observed; 0: hidden
    length: jax.Array  # int32 steps of an episode
    truncates: jax.Array  # bool: the last step truncates; False: it terminates


@struct.dataclass
class ProbeState:
    observation: jax.Array  # [B, 2] number of the step or 0, and the sign
    step: jax.Array  # [B] int32
    key: jax.Array


@dataclasses.dataclass(frozen=True)
class Probe:
    """B episodes; objective k is rewarded with scale[k] times the reward."""

    scale: tuple[float, ...] = (1.0,)
    observation_size: int = 2
    action_size: int = 1

    @property
    def num_objectives(self) -> int:
        return len(self.scale)

    def init(self, world: ProbeWorld, key: jax.Array, num_envs: int) -> ProbeState:
        key, key_sign = jax.random.split(key)
        step = jnp.zeros(num_envs, jnp.int32)
        return ProbeState(
            observation=_observe(world, step, _signs(key_sign, step)), step=step, key=key
        )

    def step(
        self, world: ProbeWorld, state: ProbeState, action: jax.Array
    ) -> tuple[ProbeState, StepOutput]:
        sign = state.observation[:, 1]
        step = state.step + 1
        ended = step >= world.length
        reward = _reward(world, sign, ended, action[:, 0])
        key, key_sign = jax.random.split(state.key)
        next_step = jnp.where(ended, 0, step)
        next_sign = jnp.where(ended, _signs(key_sign, step), sign)
        observation = _observe(world, next_step, next_sign)
        following = ProbeState(observation=observation, step=next_step, key=key)
        output = StepOutput(
            observation=observation,
            final_observation=_observe(world, step, sign),
            reward=reward[:, None] * jnp.asarray(self.scale),
            terminated=ended & ~world.truncates,
            truncated=ended & world.truncates,
            metrics={"reward": reward},
            episode={"steps": step.astype(jnp.float32), "plus": jnp.where(sign > 0, 1.0, jnp.nan)},
            extras={"step": step},
        )
        return following, output


def _signs(key: jax.Array, like: jax.Array) -> jax.Array:
    return jax.random.rademacher(key, like.shape, jnp.float32)


def _observe(world: ProbeWorld, step: jax.Array, sign: jax.Array) -> jax.Array:
    return jnp.stack([world.shows_step * step, sign], axis=-1)


def _reward(world: ProbeWorld, sign: jax.Array, last: jax.Array, action: jax.Array) -> jax.Array:
    answer = world.action_mean + world.action_by_sign * sign
    miss = jnp.square(action - answer)
    return world.constant + world.by_sign * sign + world.at_last * last - world.by_action * miss


def make_world(length: int = 1, truncates: bool = False, **numbers: float) -> ProbeWorld:
    """A probe with the given numbers, the others 0."""
    names = [f.name for f in dataclasses.fields(ProbeWorld)][:-2]
    scalars = {name: jnp.asarray(numbers.pop(name, 0.0), jnp.float32) for name in names}
    assert not numbers, f"unknown numbers: {sorted(numbers)}"
    return ProbeWorld(**scalars, length=jnp.asarray(length), truncates=jnp.asarray(truncates))
