"""The batch as a `VecEnv` of stable-baselines3."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from stable_baselines3.common.vec_env import VecEnv  # pyright: ignore[reportMissingImports]

from getup_jax.config import ConfigError
from getup_jax.gym.vector_env import GetUpVectorEnv


class SB3VecEnv(VecEnv):
    """Infos are dicts: `terminal_observation`, `TimeLimit.truncated` and `is_success` of an end."""

    def __init__(self, env: GetUpVectorEnv) -> None:
        self.env = env
        self._actions: Any = None
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)

    def reset(self) -> np.ndarray:
        """The first observations [B, O]; with the seed that `seed` was given, if any."""
        seed = self._seeds[0]
        self._reset_seeds()
        observation, _ = self.env.reset(seed=seed)
        return observation

    def step_async(self, actions: np.ndarray) -> None:
        """Take actions [B, A]; the step itself is in `step_wait`."""
        self._actions = actions

    def step_wait(self) -> Any:
        """Observations [B, O], rewards [B], dones [B] and infos."""
        observation, reward, terminated, truncated, infos = self.env.step(self._actions)
        done = terminated | truncated
        found: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for index in np.flatnonzero(done):
            found[index] = _final(infos, int(index), bool(truncated[index]))
        return observation, reward.astype(np.float32), done, found

    def close(self) -> None:
        """Free the renderer."""
        self.env.close()

    def get_images(self) -> Sequence[np.ndarray | None]:
        """A picture of every episode."""
        return self.env.render() or [None] * self.num_envs

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of the batch, once for each of the episodes."""
        return [getattr(self.env, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Not possible: the episodes are one program."""
        raise ConfigError(f"{attr_name}: cannot be set; give it when the environment is made")

    def env_method(
        self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any
    ) -> list[Any]:
        """Not possible: the episodes are one program."""
        raise ConfigError(f"{method_name}: cannot be called of single episodes of a batch")

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """False: no episode has a wrapper of its own."""
        return [False] * len(list(self._get_indices(indices)))


def _final(infos: dict[str, Any], index: int, truncated: bool) -> dict[str, Any]:
    """The info of an episode that ended."""
    last = infos["final_info"]
    info = {name: float(x[index]) for name, x in last.items() if not name.startswith("_")}
    verdicts = [info.get(name) for name in ("success", "stand_success", "clip_success")]
    known = [value for value in verdicts if value is not None and np.isfinite(value)]
    if known:
        info["is_success"] = known[0]
    return info | {
        "terminal_observation": infos["final_obs"][index],
        "TimeLimit.truncated": truncated,
    }
