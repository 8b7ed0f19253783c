"""From a config to a composite-motion task: character, clips, start states."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator

import jax
import jax.numpy as jnp
import numpy as np

from getup_jax.config import CompositeConfig, Config, ConfigError, GroupConfig, TaskConfig
from getup_jax.core.types import Engine
from getup_jax.envs.composite.goals.combine import equipment_of, make_goals
from getup_jax.envs.composite.groups import objective_weights, resolve_groups
from getup_jax.envs.composite.reference_state_init import (
    Family,
    Following,
    families,
    hinges_of,
    mixed,
    reference_states,
    repeated_as,
    resampled,
)
from getup_jax.envs.composite.reference_windows import make_references
from getup_jax.envs.composite.task import CompositeTask, CompositeWorld, Starts
from getup_jax.motion.authoring.loops import repeated
from getup_jax.motion.authoring.path_editing import bent
from getup_jax.motion.clips import Clip, MotionError
from getup_jax.motion.named_clips import named_clips
from getup_jax.physics.character import CharacterSpec, load_character
from getup_jax.physics.engine import make_engine

_STILL_RAD = 0.6  # scale of a hinge that the clips do not move
_SPREADS = 4.0  # added to it: times the standard deviation of the clips' angles


@dataclasses.dataclass(frozen=True, eq=False)
class BuiltComposite:
    """A composite task and what belongs to it."""

    environment: CompositeTask
    world: CompositeWorld
    clips: dict[str, list[Clip]]  # by group
    following: Following  # how the clips go on after the start states


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
    start = start_group(composite)
    starts, following = start_states(composite, character, clips, engine, config.task.pool_size)
    _check_starts(task, starts, f"composite.groups.{start}.clips")
    goals.check_numbers(starts.physics.kinematics)
    log(f"engine: {engine.name}; {len(starts.history)} start states along {start}'s clips")
    world = CompositeWorld(
        starts=starts, references=references, **_targets(task, clips, config.task)
    )
    return BuiltComposite(task, world, clips, following)


def start_group(config: CompositeConfig) -> str:
    """The group along whose clips episodes start."""
    return config.start_group or list(config.groups)[-1]


def start_states(
    config: CompositeConfig,
    character: CharacterSpec,
    clips: dict[str, list[Clip]],
    engine: Engine,
    most: int,
) -> tuple[Starts, Following]:
    """At most `most` states along the clips of the start group, and what follows each."""
    start = start_group(config)
    turns = config.groups[start].turns
    again = [resampled(repeated(clip, 2), 1.0 / engine.control_dt) for clip in clips[start]]
    moving: list[Family] = list(families(again, turns))
    after = moving
    if len(config.groups) > 1 and (config.start_mixed or config.warm_start):
        after = mixed(moving, start, config, character, clips)
        moving = after if config.start_mixed else repeated_as(after, moving)
    return reference_states(moving, turns, character, engine, most, after)


def _targets(task: CompositeTask, clips: dict[str, list[Clip]], config: TaskConfig) -> dict:
    """Servo targets: a pose, moved by shares of each hinge's range."""
    lower, upper = task.character.joint_lower, task.character.joint_upper
    margin = config.target_margin_rad
    values = {
        "target_centre": action_centre(task.config, task.character, clips),
        "target_scale": action_scale(task.config, task.character, clips),
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
    for own, angles in _own_hinges(config, character, clips):
        centre[own] = angles.mean(axis=0)
    return centre


def action_scale(
    config: CompositeConfig, character: CharacterSpec, clips: dict[str, list[Clip]]
) -> np.ndarray:
    """How far (rad, [J]) an action of 1 moves each hinge's target.

    `range`: the hinge's whole range; its noise moves an arm that a clip holds still several times
    as much as the clip moves anything. `clips`: as much as the clips move it, and a little more.
    """
    full = character.joint_upper - character.joint_lower
    if config.action_range == "range":
        return config.action_scale * full
    spread = np.zeros_like(full)
    for own, angles in _own_hinges(config, character, clips):
        spread[own] = angles.std(axis=0)
    return config.action_scale * np.minimum(full, _STILL_RAD + _SPREADS * spread)


def _own_hinges(
    config: CompositeConfig, character: CharacterSpec, clips: dict[str, list[Clip]]
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Of every group: its hinges [J] bool, and their angles [frames, hinges] in its clips."""
    for name, own in hinges_of(config, character):
        frames = np.concatenate([clip.qpos[:, 7:] for clip in clips[name]])
        yield own, frames[:, own]


def load_clips(config: CompositeConfig, character: CharacterSpec) -> dict[str, list[Clip]]:
    """The clips of every group, each along all of the group's arcs before the next one."""
    return {name: _load_group(name, part, character) for name, part in config.groups.items()}


def _load_group(name: str, config: GroupConfig, character: CharacterSpec) -> list[Clip]:
    clips = named_clips(config.clips, character, f"composite.groups.{name}.clips")
    try:
        return [bent(clip, turn, character) for clip in clips for turn in config.turns]
    except MotionError as error:
        raise ConfigError(f"composite.groups.{name}.turns: {error}") from None


def _check_starts(task: CompositeTask, starts: Starts, key: str) -> None:
    kinematics = starts.physics.kinematics
    fallen = np.asarray(jax.jit(task.has_fallen)(kinematics) | ~kinematics.finite)
    if fallen.all():
        raise ConfigError(
            f"{key}: every frame counts as a fall; expected clips on the feet, or a lower "
            f"composite.fall_height_m than {task.config.fall_height_m}"
        )
