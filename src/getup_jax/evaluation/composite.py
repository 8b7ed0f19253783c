"""Scores of a policy of composite motion: imitation error of every group, goals, falls."""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import numpy as np

from getup_jax.config import Config
from getup_jax.envs.composite.build import BuiltComposite
from getup_jax.envs.composite.groups import Group
from getup_jax.envs.composite.reference_state_init import resampled
from getup_jax.envs.composite.reference_windows import link_poses
from getup_jax.evaluation.composite_rollout import CompositeEpisodes, restore, run_composite
from getup_jax.evaluation.scenario import Scenario
from getup_jax.motion.clips import Clip
from getup_jax.motion.dtw import imitation_error
from getup_jax.runtime.checkpoint import LoadedPolicy
from getup_jax.runtime.console import Display

EPISODES = 32  # by default


@dataclasses.dataclass(frozen=True)
class GroupScore:
    """How a group imitates its clips."""

    mean: float  # imitation error (m), over episodes
    std: float
    travel: float  # how far its links move, as a share of what they do in the clips


@dataclasses.dataclass(frozen=True)
class GoalScore:
    """How a goal is reached."""

    reward: float  # mean over all steps, 0 from a fall on
    success: float | None  # share of the attempts, mean over episodes; None: there were none


@dataclasses.dataclass(frozen=True)
class CompositeScores:
    """Means over the episodes of a policy of composite motion."""

    groups: dict[str, GroupScore]
    goals: dict[str, GoalScore]
    meta_weight: dict[str, dict[str, float]]  # mean and std of w over the hinges of every group
    ratio: float  # largest imitation error of a group by the smallest
    fall_share: float  # of the episodes, that have a fall
    episodes: int


def evaluate(
    loaded: LoadedPolicy, scenario: Scenario, display: Display
) -> tuple[BuiltComposite, CompositeEpisodes, CompositeScores]:
    """Run and score the episodes; raises ConfigError where the policy cannot be asked that."""
    scenario.check_composite()
    found = restore(evaluation_config(loaded.config, scenario), loaded, display.log)
    episodes = run_composite(found.job, found.policy, episode_count(scenario), scenario.seed)
    return found.built, episodes, score_composite(found.built, episodes)


def episode_count(scenario: Scenario) -> int:
    """As many as asked for, or the default."""
    return scenario.episodes or EPISODES


def goal_reward(reward: np.ndarray, fell: np.ndarray) -> float:
    """Mean of a goal's rewards [N, T] over all steps, 0 from a fall [N, T] on.

    What a step pays that ends a training episode, `composite.end_reward`, is not the goal's.
    """
    alive = ~np.logical_or.accumulate(fell, axis=1)
    return float(np.where(alive, reward, 0.0).mean())


def score_composite(task: BuiltComposite, episodes: CompositeEpisodes) -> CompositeScores:
    """The imitation of every group, what became of the goals, and the share of falls.

    The travel of a group belongs beside its error: a character that stands still in a typical pose
    has a small error too, where the clips move little.
    """
    groups = {}
    for group in task.environment.groups:
        motion, references = _compared(task, group, episodes)
        each = group_errors(motion, references)
        own = np.mean([_speed(reference) for reference in references])
        travel = float(_speed(motion) / max(own, 1e-9))
        groups[group.name] = GroupScore(float(each.mean()), float(each.std()), travel)
    means = [group.mean for group in groups.values()]
    goals = {}
    for index, name in enumerate(task.environment.goals.names):
        share = episodes.goal_success[:, index]
        known = share[np.isfinite(share)]
        goals[name] = GoalScore(
            reward=goal_reward(episodes.goal_reward[:, :, index], episodes.fell),
            success=float(known.mean()) if known.size else None,
        )
    return CompositeScores(
        groups=groups,
        goals=goals,
        meta_weight=_meta_weights(task, episodes),
        ratio=max(means) / max(min(means), 1e-9),
        fall_share=float(episodes.fell.any(axis=1).mean()),
        episodes=len(episodes.fell),
    )


def to_json(scores: CompositeScores) -> dict[str, Any]:
    """The scores as plain values; `imitation_error_m` are those of the groups."""
    values = dataclasses.asdict(scores)
    return {"imitation_error_m": values.pop("groups"), **values}


def description(loaded: LoadedPolicy, scenario: Scenario, task: BuiltComposite) -> dict[str, Any]:
    """Whose scores they are, and under which conditions."""
    return {
        "policy": {"path": str(loaded.path), "seed": loaded.config.seed, **loaded.metadata},
        "conditions": {"seed": scenario.seed, "engine": task.environment.engine.name},
    }


def imitation_errors(task: BuiltComposite, episodes: CompositeEpisodes) -> dict[str, np.ndarray]:
    """Imitation error [N] (m) of every episode, by group."""
    groups = task.environment.groups
    return {g.name: group_errors(*_compared(task, g, episodes)) for g in groups}


def group_errors(motion: np.ndarray, references: list[np.ndarray]) -> np.ndarray:
    """Error [N] (m) of motions [N, T, links, 3] to the nearest of the references [S, links, 3]."""
    found = [imitation_error(motion, reference, loop=True) for reference in references]
    return np.stack(found).min(axis=0)


def _compared(
    task: BuiltComposite, group: Group, episodes: CompositeEpisodes
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Positions [N, T, links, 3] of a group's links in the episodes, and those of its clips."""
    motion = _seen(group, episodes.position, episodes.quaternion)
    rate = 1.0 / task.environment.engine.control_dt
    clips = [resampled(clip, rate) for clip in task.clips[group.name]]
    return motion, [_reference(task, group, clip) for clip in clips]


def _meta_weights(task: BuiltComposite, episodes: CompositeEpisodes) -> dict[str, Any]:
    """Mean and std of the meta policy's weights over the hinges of every group [C figure 8]."""
    if episodes.meta_weight is None:
        return {}
    env, found = task.environment, {}
    for group in env.groups:
        own = episodes.meta_weight[..., np.isin(env.character.joint_link, group.links)]
        found[group.name] = {"mean": float(own.mean()), "std": float(own.std())}
    return found


def _reference(task: BuiltComposite, group: Group, clip: Clip) -> np.ndarray:
    """Positions [S, links, 3] of a group's links in a clip that repeats."""
    position, quaternion = link_poses(clip.qpos[:-1], task.environment.character)
    return _seen(group, position[None], quaternion[None])[0]


def _speed(position: np.ndarray) -> float:
    """Mean way (m) of the links [..., T, links, 3] from frame to frame."""
    return float(np.linalg.norm(np.diff(position, axis=-3), axis=-1).mean())


def _seen(group: Group, position: np.ndarray, quaternion: np.ndarray) -> np.ndarray:
    """Positions [N, T, links, 3] in the group's frame of reference at each moment."""
    window = jax.jit(group.window)(position[:, :, None], quaternion[:, :, None])
    return np.asarray(group.positions(window))[:, :, 0]


def evaluation_config(config: Config, scenario: Scenario) -> Config:
    """The training config with the seed and the engine of the scenario."""
    config = dataclasses.replace(config, seed=scenario.seed)
    if scenario.engine is not None:
        physics = dataclasses.replace(config.physics, engine=scenario.engine, solver="auto")
        config = dataclasses.replace(config, physics=physics)
    return config


def table(scores: CompositeScores) -> str:
    """The scores in lines for people."""
    lines = ["group            imitation error (m)   travel (share of the clips')"]
    for name, group in scores.groups.items():
        spread = f"{group.mean:.3f} +- {group.std:.3f}"
        lines.append(f"{name:16} {spread:21} {group.travel:.2f}")
    for name, goal in scores.goals.items():
        share = "-" if goal.success is None else f"{100 * goal.success:.0f} %"
        lines.append(f"{name:16} reward {goal.reward:.3f}, reached {share}")
    for name, weight in scores.meta_weight.items():
        lines.append(f"{name:16} weight of the meta policy {weight['mean']:.2f}")
    lines.append(f"largest / smallest {scores.ratio:.2f}")
    lines.append(f"episodes with a fall {100 * scores.fall_share:.0f} %")
    return "\n".join(lines)
