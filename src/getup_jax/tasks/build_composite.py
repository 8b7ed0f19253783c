"""From a config to a composite-motion task: character, clips, start states."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import jax.numpy as jnp
import numpy as np

from getup_jax.config import CompositeConfig, Config, ConfigError, TaskConfig
from getup_jax.motion.clips import Clip
from getup_jax.motion.named_clips import named_clips
from getup_jax.physics.character import CharacterSpec, load_character
from getup_jax.physics.engine import make_engine
from getup_jax.tasks.composite import (
    FRAMES,
    CompositeTask,
    CompositeWorld,
    Starts,
    link_state,
)
from getup_jax.tasks.goals.combine import equipment_of, make_goals
from getup_jax.tasks.groups import objective_weights, resolve_groups
from getup_jax.tasks.reference_windows import make_references, unrolled
from getup_jax.tasks.references import velocities
from getup_jax.types import Engine, take


@dataclasses.dataclass(frozen=True, eq=False)
class BuiltComposite:
    """A composite task and what belongs to it."""

    environment: CompositeTask
    world: CompositeWorld
    clips: dict[str, list[Clip]]  # by group


def build_composite(config: Config, log: Callable[[str], None]) -> BuiltComposite:
    """Resolve the groups, load their clips and make the start states."""
    composite = config.composite
    if composite is None:
        raise ConfigError("composite: expected groups, got null")
    character = load_character(config.physics, equipment=equipment_of(composite.goals))
    resolve_groups(composite, character)  # a mistake in them is told before the clips are read
    clips = load_clips(composite, character)
    for name, found in clips.items():
        log(f"group {name}: {', '.join(f'{c.name} {c.duration:.1f} s' for c in found)}")
    return assemble_composite(config, character, clips, log)


def assemble_composite(
    config: Config,
    character: CharacterSpec,
    clips: dict[str, list[Clip]],
    log: Callable[[str], None],
) -> BuiltComposite:
    """The task from its finished parts."""
    composite = config.composite
    assert composite is not None
    groups = resolve_groups(composite, character)
    engine = make_engine(character, config.physics)
    goals = make_goals(composite.goals, character, engine.control_dt)
    task = CompositeTask(engine, character, composite, groups, goals)
    objective_weights(composite, task.objectives)  # a mistake in them is told before anything long
    references = {
        group.name: make_references(clips[group.name], group, character, engine.control_dt)
        for group in groups
    }
    start = composite.start_group or groups[-1].name
    starts = _starts(clips[start], character, engine, config.task.pool_size)
    _check_starts(task, starts, f"composite.groups.{start}.clips")
    log(f"engine: {engine.name}; {len(starts.history)} start states along {start}'s clips")
    world = CompositeWorld(
        starts=starts, references=references, **_targets(task, clips, config.task)
    )
    return BuiltComposite(task, world, clips)


def _targets(task: CompositeTask, clips: dict[str, list[Clip]], config: TaskConfig) -> dict:
    """Servo targets: a pose, moved by shares of each hinge's range."""
    lower, upper = task.character.joint_lower, task.character.joint_upper
    margin = config.target_margin_rad
    values = {
        "target_centre": action_centre(task.config, task.character, clips),
        "target_scale": task.config.action_scale * (upper - lower),
        "target_lower": lower - margin,
        "target_upper": upper + margin,
    }
    return {name: jnp.asarray(value, jnp.float32) for name, value in values.items()}


def action_centre(
    config: CompositeConfig, character: CharacterSpec, clips: dict[str, list[Clip]]
) -> np.ndarray:
    """Hinge angles [J] of action 0.

    With `neutral`, an arm that a clip holds up all the time is many standard deviations of the
    first policy away. So the default is each hinge's mean over the clips of its link's group.
    """
    centre = character.neutral_qpos[7:].copy()
    if config.action_centre == "neutral":
        return centre
    groups = resolve_groups(config, character)
    for group in reversed(groups):  # of two groups with one link, the first one counts
        own = np.isin(character.joint_link, group.links)
        frames = np.concatenate([clip.qpos[:, 7:] for clip in clips[group.name]])
        centre[own] = frames.mean(axis=0)[own]
    return centre


def load_clips(config: CompositeConfig, character: CharacterSpec) -> dict[str, list[Clip]]:
    """The clips of every group."""
    return {
        name: named_clips(part.clips, character, f"composite.groups.{name}.clips")
        for name, part in config.groups.items()
    }


def _starts(clips: Sequence[Clip], character: CharacterSpec, engine: Engine, most: int) -> Starts:
    """Every frame of the clips (at most `most`) that has enough frames before it."""
    qpos, qvel, rows, count = [], [], [], 0
    for clip in clips:
        moving = resampled(unrolled(clip), 1.0 / engine.control_dt)
        qvel.append(velocities(moving, character))
        qpos.append(moving.qpos[:-1])
        rows.append(count + np.arange(FRAMES, len(qpos[-1])))
        count += len(qpos[-1])
    chosen = np.concatenate(rows)
    chosen = chosen[np.linspace(0, len(chosen) - 1, min(most, len(chosen))).astype(int)]
    physics = engine.place(np.concatenate(qpos), np.concatenate(qvel))
    frames = link_state(physics.kinematics)
    before = chosen[:, None] + np.arange(-FRAMES, 1)
    return Starts(physics=take(physics, jnp.asarray(chosen)), history=frames[before])


def resampled(clip: Clip, fps: float) -> Clip:
    """A clip at another rate, by linear interpolation and normalised quaternions."""
    if abs(clip.fps - fps) < 1e-6:
        return clip
    times = np.arange(0.0, clip.duration + 1e-9, 1.0 / fps)
    place = np.minimum(times * clip.fps, len(clip.qpos) - 1)
    low = np.minimum(np.floor(place).astype(int), len(clip.qpos) - 2)
    share = (place - low)[:, None]
    before, after = clip.qpos[low], clip.qpos[low + 1].copy()
    after[:, 3:7] *= np.where(np.sum(before[:, 3:7] * after[:, 3:7], axis=1) < 0, -1, 1)[:, None]
    qpos = (1 - share) * before + share * after
    qpos[:, 3:7] /= np.linalg.norm(qpos[:, 3:7], axis=1, keepdims=True)
    return dataclasses.replace(clip, qpos=qpos, fps=fps)


def _check_starts(task: CompositeTask, starts: Starts, key: str) -> None:
    kinematics = starts.physics.kinematics
    fallen = np.asarray(task.has_fallen(kinematics) | ~kinematics.finite)
    if fallen.all():
        raise ConfigError(
            f"{key}: every frame counts as a fall; expected clips on the feet, or a lower "
            f"composite.fall_height_m than {task.config.fall_height_m}"
        )
