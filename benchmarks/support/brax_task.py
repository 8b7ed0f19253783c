"""The functional pair of an environment as a batched environment of Brax, for its PPO."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
from brax.envs.base import Env, State  # pyright: ignore[reportMissingImports]

from getup_jax import api


class BraxTask(Env):
    """B episodes that start anew by themselves: to be used with `wrap_env=False`."""

    def __init__(self, env: api.Env) -> None:
        self._env, self._functional = env, env.functional()

    def reset(self, rng: jax.Array) -> State:
        """All episodes anew; rng [B, 2] of which the first key is used."""
        observation, state = self._functional.reset(self._env.world, rng[0])
        zero = jnp.zeros(self._env.num_envs, jnp.float32)
        episode = {"sum_reward": zero, "length": zero}  # asked for, not used
        info = {"truncation": zero, "episode_done": zero, "episode_metrics": episode}
        return State(state, observation, zero, zero, {}, info)

    def step(self, state: State, action: jax.Array) -> State:
        """One control step."""
        observation, inner, reward, done, info = self._functional.step(
            self._env.world, state.pipeline_state, action
        )
        return state.replace(
            pipeline_state=inner,
            obs=observation,
            reward=reward,
            done=done.astype(jnp.float32),
            info={**state.info, "truncation": info["truncated"].astype(jnp.float32)},
        )

    @property
    def observation_size(self) -> int:
        return self._env.observation_size

    @property
    def action_size(self) -> int:
        return self._env.action_size

    @property
    def backend(self) -> str:
        return "mjx"


def make_task(config: Any, num_envs: int) -> BraxTask:
    """The task of a config in whole batches."""
    return BraxTask(api.make_env(config, num_envs, training=True))
