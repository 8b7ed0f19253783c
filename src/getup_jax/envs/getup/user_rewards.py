"""Reward terms of users for getting up: factors of the reward, by the names of `task.rewards`."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import jax
import jax.numpy as jnp
from flax import struct

from getup_jax.config import ConfigError
from getup_jax.config.from_outside import from_outside
from getup_jax.config.registry import Registry
from getup_jax.core.types import Kinematics
from getup_jax.envs.getup.observation import Posture


@struct.dataclass
class RewardInputs:
    """What a reward term knows of B simulations after a control step."""

    kinematics: Kinematics  # world frame
    posture: Posture  # heading frame of the root; its features are height (m) and angles (rad)
    target: jax.Array  # [B, 3] the curves now: height (m), side and front angle (rad)
    phase: jax.Array  # [B] share of the curve that is over; more than 1 while standing
    offset: jax.Array  # [B, J] servo offsets (rad)


RewardTerm = Callable[[RewardInputs], jax.Array]  # [B] in [0, 1]; pure, runs inside jit
REWARDS: Registry[RewardTerm] = Registry("getup_jax.rewards", {})


def check(exponents: Mapping[str, float], own: tuple[str, ...]) -> None:
    """Raise ConfigError for a name that nobody registered, or that is one of the task's `own`."""
    for name in exponents:
        if name in own:
            raise ConfigError(f"task.rewards: {name!r} is a term of the task; choose another name")
        REWARDS.choose(name, "task.rewards")


def terms(exponents: Mapping[str, float], inputs: RewardInputs) -> dict[str, jax.Array]:
    """r_i^k_i [B] of every term i, by its name, with its exponent k_i."""
    found = {}
    for name, exponent in exponents.items():
        with from_outside(f"task.rewards.{name}"):
            value = REWARDS[name](inputs)
        shape = inputs.phase.shape
        if jnp.shape(value) != shape:
            raise ConfigError(
                f"task.rewards: {name}: expected one number a simulation, shape {shape}, got "
                f"{jnp.shape(value)}"
            )
        found[name] = jnp.clip(value, 0.0, 1.0) ** exponent
    return found
