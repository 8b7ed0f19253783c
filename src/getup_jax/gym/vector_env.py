"""A batch of episodes as a Gymnasium `VectorEnv`, which start anew in the step that ends them."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from gymnasium import error, spaces  # pyright: ignore[reportMissingImports]
from gymnasium.vector import AutoresetMode, VectorEnv  # pyright: ignore[reportMissingImports]
from gymnasium.vector.utils import batch_space  # pyright: ignore[reportMissingImports]

from getup_jax import api
from getup_jax.config import ConfigError
from getup_jax.evaluation.scenario import Scenario
from getup_jax.functional import reward_weights
from getup_jax.gym.pictures import Pictures

SEEDS = 2**31

# Of every number of an action, in standard deviations of the pose prior's latents, or times the
# scale of an offset. stable-baselines3 wants bounds. Trained policies stay within 6; the
# environment clips servo targets, not actions.
ACTION_LIMIT = 10.0


class Episodes:
    """What environments of one episode and of many have in common: the task, and its state."""

    metadata: dict[str, Any]

    def _build(
        self,
        num_envs: int,
        config: Any,
        render_mode: str | None,
        training: bool | None,
        scenario: Scenario | None,
    ) -> None:
        """See `GetUpVectorEnv`."""
        self.render_mode = check_render_mode(render_mode)
        training = scenario is None if training is None else training
        self.env = api.make_env(config, num_envs, scenario, training)
        self.metadata = {**self.metadata, "render_fps": round(1.0 / self.env.control_dt)}
        self._weights = np.array(reward_weights(self.env.config, self.env.environment))
        self._pictures = Pictures(self.env)
        self._state: Any = None

    def _begin(self, random: np.random.Generator) -> np.ndarray:
        """All episodes anew; their observations [B, O]."""
        self._state = self.env.reset(int(random.integers(SEEDS)))
        self._pictures.forget(np.ones(self.env.num_envs, bool))
        return np.array(self._state.observation)


class GetUpVectorEnv(Episodes, VectorEnv):
    """`num_envs` episodes of a config's task.

    Observations [B, O], actions [B, A] and what they mean are those of `getup_jax.make_env`; the
    reward is the weighted sum of its objectives. `infos` has the metrics of a step, and where an
    episode ended `final_obs` and `final_info`, with its verdicts, such as `success`.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012
        "render_modes": ["rgb_array"],
        "autoreset_mode": AutoresetMode.SAME_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        config: Any = "flat",
        render_mode: str | None = None,
        training: bool | None = None,
        scenario: Scenario | None = None,
    ) -> None:
        """The task is built; the first step compiles it.

        Args:
            num_envs: B.
            config: a `Config`, a file or the name of one, or a `Policy`.
            render_mode: None or "rgb_array".
            training: episodes as a training has them, or whole ones; None: unless a scenario is
                given.
            scenario: how episodes begin.

        Raises ConfigError for what is not possible.
        """
        self._build(num_envs, config, render_mode, training, scenario)
        self.num_envs = num_envs
        self.single_observation_space, self.single_action_space = make_spaces(self.env)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """All episodes anew; the same seed gives the same ones."""
        check_reset(seed, options)
        super().reset(seed=seed)
        return self._begin(self.np_random), {}

    def step(
        self, actions: Any
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """One control step; episodes that it ends have begun anew in the observations."""
        if self._state is None:
            raise error.ResetNeeded("step: expected a call of reset before the first step")
        actions = check_actions(actions, self.action_space.shape)
        self._state, output = self.env.step(self._state, jnp.asarray(actions))
        output = jax.device_get(output.replace(extras=None))
        done = np.asarray(output.done)
        self._pictures.forget(done)
        return (
            np.array(output.observation),
            output.reward.astype(np.float64) @ self._weights,
            np.array(output.terminated),
            np.array(output.truncated),
            _infos(output, done),
        )

    def render(self) -> tuple[np.ndarray, ...] | None:
        """A picture [rows, columns, 3] of every episode; None without a render mode."""
        if self.render_mode is None:
            return None
        if self._state is None:
            raise error.ResetNeeded("render: expected a call of reset before")
        return tuple(self._pictures.take(self._state, i) for i in range(self.num_envs))

    def close_extras(self, **_: Any) -> None:
        """Free the renderer."""
        self._pictures.close()


def make_spaces(env: api.Env) -> tuple[spaces.Box, spaces.Box]:
    """Of one observation, without bounds, and of one action."""
    observation = spaces.Box(-np.inf, np.inf, (env.observation_size,), np.float32)
    return observation, spaces.Box(-ACTION_LIMIT, ACTION_LIMIT, (env.action_size,), np.float32)


def check_render_mode(mode: str | None) -> str | None:
    """The mode; raises ConfigError for one that there is not."""
    if mode not in (None, "rgb_array"):
        raise ConfigError(f"render_mode: expected None or 'rgb_array', got {mode!r}")
    return mode


def check_reset(seed: Any, options: dict[str, Any] | None) -> None:
    """Raise ConfigError for what a reset cannot do."""
    if isinstance(seed, list | tuple):
        raise ConfigError("seed: expected one number for all episodes, got a list")
    if options:
        raise ConfigError(
            f"options: expected none, got {', '.join(map(str, options))}; episodes that end begin "
            "anew by themselves, and a scenario says how"
        )


def check_actions(actions: Any, shape: tuple[int, ...] | None) -> np.ndarray:
    """The actions as float32; raises ConfigError for another shape, or for what is not finite."""
    try:
        values = np.asarray(actions, np.float32)
    except (TypeError, ValueError) as reason:
        raise ConfigError(
            f"actions: expected an array of numbers of shape {shape}: {reason}"
        ) from None
    if values.shape != shape:
        raise ConfigError(f"actions: expected an array of shape {shape}, got {values.shape}")
    bad = np.argwhere(~np.isfinite(values))
    if len(bad):
        first = tuple(bad[0].tolist())
        raise ConfigError(
            f"actions: expected finite numbers, got {values[first]} at {first} "
            f"({len(bad)} of {values.size}); a learner that gives NaN has diverged"
        )
    return values


def _infos(output: Any, done: np.ndarray) -> dict[str, Any]:
    """Metrics where an episode goes on; where it ended, its last observation, metrics, verdicts."""
    infos = _masked(output.logged, ~done)
    if not done.any():
        return infos
    final = np.full(len(done), None, object)
    for index in np.flatnonzero(done):
        final[index] = output.final_observation[index]
    final_info = _masked({**output.logged, **output.episode}, done)
    return infos | {
        "final_obs": final,
        "_final_obs": done.copy(),
        "final_info": final_info,
        "_final_info": done.copy(),
    }


def _masked(values: dict[str, Any], mask: np.ndarray) -> dict[str, Any]:
    """As Gymnasium has it: a name's array, and the mask of where it is one under `_name`."""
    infos: dict[str, Any] = {}
    for name, value in values.items():
        infos[name], infos[f"_{name}"] = np.where(mask, value, 0.0), mask.copy()
    return infos
