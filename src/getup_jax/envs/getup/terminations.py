"""Early ends of get-up episodes [P 5.3]: a low task reward, or the head on the floor."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from getup_jax.config import TaskConfig
from getup_jax.core.quaternion import rotate
from getup_jax.core.types import Kinematics
from getup_jax.envs.getup.episode import EpisodeState
from getup_jax.physics.character import CharacterSpec
from getup_jax.physics.terrain import Ground


def head_gap(character: CharacterSpec, terrain: Ground, kinematics: Kinematics) -> jax.Array:
    """Distance [B] from the head's lowest point to the ground (m)."""
    link, offset, radius = character.head_sphere
    centre = kinematics.link_position[:, link] + rotate(
        kinematics.link_quaternion[:, link], jnp.asarray(offset, jnp.float32)
    )
    return terrain.clearance(centre, radius)


def counted(
    config: TaskConfig,
    control_dt: float,
    state: EpisodeState,
    task_reward: jax.Array,
    head: jax.Array,
    grace_s: float = 0.0,
) -> tuple[EpisodeState, dict[str, jax.Array]]:
    """The state with one more step of each, and which [B] were held for too long.

    task_reward [B]: of this step. head [B]: whether it is on the floor. grace_s: for so long that
    only costs the reward, see `paid`.
    """
    low = task_reward < config.terminate_reward
    state = state.replace(
        low_steps=jnp.where(low, state.low_steps + 1, 0),
        head_steps=jnp.where(head, state.head_steps + 1, 0),
    )
    most = config.terminate_after_s
    causes = {
        "low_reward": state.low_steps > _steps(most, control_dt),
        "head": state.head_steps > _steps(most + grace_s, control_dt),
    }
    return state, causes


def paid(
    config: TaskConfig, control_dt: float, state: EpisodeState, reward: jax.Array, grace_s: float
) -> jax.Array:
    """The reward [B]; 0 in a grace time, in which an episode would be over without it."""
    if grace_s == 0:
        return reward
    in_time = state.head_steps <= _steps(config.terminate_after_s, control_dt)
    return jnp.where(in_time, reward, 0.0)


def _steps(seconds: float, control_dt: float) -> float:
    """Control steps in that time; as many are not yet more than it."""
    return seconds / control_dt + 1e-3
