"""One episode at a time as a Gymnasium `Env`."""

from __future__ import annotations

import functools
from typing import Any

import gymnasium  # pyright: ignore[reportMissingImports]
import jax
import jax.numpy as jnp
import numpy as np
from gymnasium import error  # pyright: ignore[reportMissingImports]

from getup_jax.evaluation.scenario import Scenario
from getup_jax.gym.vector_env import Episodes, check_actions, check_reset, make_spaces


class GetUpEnv(Episodes, gymnasium.Env):
    """As `GetUpVectorEnv`, of one episode, which `reset` begins; slower by far than a batch."""

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"]}  # noqa: RUF012

    def __init__(
        self,
        config: Any = "flat",
        render_mode: str | None = None,
        training: bool | None = None,
        scenario: Scenario | None = None,
    ) -> None:
        """See `GetUpVectorEnv`."""
        self._build(1, config, render_mode, training, scenario)
        self.observation_space, self.action_space = make_spaces(self.env)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """A new episode; the same seed gives the same one."""
        check_reset(seed, options)
        super().reset(seed=seed)
        return self._begin(self.np_random)[0], {}

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """One control step."""
        if self._state is None:
            raise error.ResetNeeded("step: expected a call of reset before the first step")
        action = check_actions(action, self.action_space.shape)
        self._state, output = self._advance(self.env.world, self._state, jnp.asarray(action)[None])
        output = jax.device_get(output.replace(extras=None))
        info = {name: float(value[0]) for name, value in output.logged.items()}
        if output.done[0]:
            info |= {name: float(value[0]) for name, value in output.episode.items()}
        return (
            np.array(output.final_observation[0]),
            float(output.reward[0].astype(np.float64) @ self._weights),
            bool(output.terminated[0]),
            bool(output.truncated[0]),
            info,
        )

    def render(self) -> Any:
        """A picture [rows, columns, 3]; None without a render mode."""
        if self.render_mode is None:
            return None
        if self._state is None:
            raise error.ResetNeeded("render: expected a call of reset before")
        return self._pictures.take(self._state, 0)

    def close(self) -> None:
        """Free the renderer."""
        self._pictures.close()

    @functools.cached_property
    def _advance(self) -> Any:
        return jax.jit(self.env.environment.advance)
