"""Whether episodes got up, by several rules that one rollout answers.

    ours     at the end the neck was on average above 0.9 of the curve's end while standing, and
             above 0.85 throughout the last second (`envs/getup/episode.py`)
    sca2022  [P 6.3] "able to remain standing": above 0.85 at the end
    thesis   [T 2.8] a whole rise and three seconds of standing: above 0.85 throughout these
    host     Huang et al. 2025, `eval_ground.py`: the base was above 0.7 m once, and never below
             0.5 m afterwards, on a robot whose target height is 0.75 m; here as shares of it

The first three want an episode that no early end of [P 5.3] would have cut short: the task reward
below 0.1, or the head on the floor, for more than 0.3 s. HoST has none, so that the rollout goes on
(`Scenario.early_termination`). The 0.85 of sca2022 and thesis are ours; the papers give no number.
"""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np

from getup_jax.config import TaskConfig
from getup_jax.envs.getup.episode import STAND_LOWEST
from getup_jax.evaluation.rollout import Episodes

HOST_TARGET_M, HOST_UP_M, HOST_DOWN_M = 0.75, 0.7, 0.5  # of the Unitree G1's pelvis
RULES = ("ours", "sca2022", "thesis", "host")


def verdicts_of(episodes: Episodes) -> dict[str, np.ndarray]:
    """Whether each of the episodes [N] got up, by rule."""
    env, trace = episodes.task.environment, episodes.trace
    ground = episodes.task.world.terrain.height(jnp.asarray(trace.qpos[..., :2]))
    base = trace.qpos[..., 2] - np.asarray(ground)
    share = base / float(env.character.neutral_qpos[2])
    return verdicts(trace, share, env.config.stand_time_s, env.engine.control_dt)


def verdicts(
    trace: Any, base: np.ndarray, stand_time_s: float, control_dt: float
) -> dict[str, np.ndarray]:
    """Whether each of the episodes [N] got up, by rule.

    trace: a `Trace` without early ends. base [T, N]: height of the pelvis over the ground, as a
    share of what it is standing.
    """
    running = trace.running
    final = np.where(running, trace.time, -np.inf).argmax(axis=0)
    episode = np.arange(running.shape[1])
    last = trace.time[final, episode]
    # simulations that fail do not come to the end
    whole = last > trace.duration[0] + stand_time_s - 0.75 * control_dt
    fair = whole & ~ended_early(trace, control_dt)
    up = trace.features[..., 0] >= STAND_LOWEST * trace.target[final, episode, 0]
    standing = running & (trace.time > trace.duration)
    return {
        "ours": fair & trace.success.any(axis=0),
        "sca2022": fair & up[final, episode],
        "thesis": fair & (up | ~standing).all(axis=0),
        "host": whole & host(base, running),
    }


def host(base: np.ndarray, running: np.ndarray) -> np.ndarray:
    """HoST's rule for base heights [T, N] as shares of the standing one: up once, never down."""
    stood = np.maximum.accumulate(running & (base > HOST_UP_M / HOST_TARGET_M), axis=0)
    fell = stood & running & (base < HOST_DOWN_M / HOST_TARGET_M)
    return stood[-1] & ~fell.any(axis=0)


def ended_early(trace: Any, control_dt: float) -> np.ndarray:
    """Which of the episodes [N] the rules of [P 5.3] would have ended."""
    most = TaskConfig.terminate_after_s / control_dt + 1e-3
    low = trace.task_reward < TaskConfig.terminate_reward
    head = trace.head_gap < TaskConfig.head_clearance_m
    return np.logical_or(*(_longest(x & trace.running) > most for x in (low, head)))


def _longest(holds: np.ndarray) -> np.ndarray:
    """The longest run [N] of steps in which it [T, N] holds."""
    run = longest = np.zeros(holds.shape[1], int)
    for now in holds:
        run = np.where(now, run + 1, 0)
        longest = np.maximum(longest, run)
    return longest
