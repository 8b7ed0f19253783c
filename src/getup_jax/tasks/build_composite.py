"""From a config to a composite-motion task: character, clips, start states."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence

import jax.numpy as jnp
import numpy as np

from getup_jax.config import CompositeConfig, Config, ConfigError, TaskConfig
from getup_jax.motion.clips import Clip
from getup_jax.motion.named_clips import named_clips
from getup_jax.physics.character import CharacterSpec, load_character
from getup_jax.physics.engine import make_engine
from getup_jax.tasks.composite import CompositeTask, CompositeWorld, Starts
from getup_jax.tasks.goals.combine import equipment_of, make_goals
from getup_jax.tasks.groups import objective_weights, resolve_groups
from getup_jax.tasks.link_frames import FRAMES, link_state
from getup_jax.tasks.reference_windows import make_references, unrolled
from getup_jax.tasks.references import velocities
from getup_jax.types import Engine, take

FOLLOWING = 32  # frames after a start that are kept
_STILL_RAD = 0.6  # scale of a hinge that the clips do not move
_MIXES = 8  # starts of every frame of the start group's clips
_SPREADS = 4.0  # added to it: times the standard deviation of the clips' angles


@dataclasses.dataclass(frozen=True, eq=False)
class BuiltComposite:
    """A composite task and what belongs to it."""

    environment: CompositeTask
    world: CompositeWorld
    clips: dict[str, list[Clip]]  # by group
    # [P, FOLLOWING, J] hinge angles (rad) of the frames after each start; NaN: past the clip's end
    following: np.ndarray


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
    moving = [resampled(unrolled(clip), 1.0 / engine.control_dt) for clip in clips[start]]
    if composite.start_mixed:
        moving = mixed(moving, start, composite, character, clips)
    starts, following = _starts(moving, character, engine, config.task.pool_size)
    _check_starts(task, starts, f"composite.groups.{start}.clips")
    log(f"engine: {engine.name}; {len(starts.history)} start states along {start}'s clips")
    world = CompositeWorld(
        starts=starts, references=references, **_targets(task, clips, config.task)
    )
    return BuiltComposite(task, world, clips, following)


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
    for name, own in _hinges_of(config, character):
        frames = np.concatenate([clip.qpos[:, 7:] for clip in clips[name]])
        yield own, frames[:, own]


def _hinges_of(
    config: CompositeConfig, character: CharacterSpec
) -> Iterator[tuple[str, np.ndarray]]:
    """Of every group: its name and its hinges [J] bool; of two with one link the first is last."""
    for group in reversed(resolve_groups(config, character)):
        yield group.name, np.isin(character.joint_link, group.links)


def load_clips(config: CompositeConfig, character: CharacterSpec) -> dict[str, list[Clip]]:
    """The clips of every group."""
    return {
        name: named_clips(part.clips, character, f"composite.groups.{name}.clips")
        for name, part in config.groups.items()
    }


def mixed(
    moving: Sequence[Clip],
    start: str,
    config: CompositeConfig,
    character: CharacterSpec,
    clips: dict[str, list[Clip]],
) -> list[Clip]:
    """The start group's clips, each _MIXES times with the other groups' hinges from their clips.

    These begin anywhere; all are at the same rate. Otherwise an arm starts where the clip of the
    legs has it, and episodes begin with a motion that no clip of the arm has.
    """
    rng = np.random.default_rng(0)
    found = []
    for clip in moving:
        for _ in range(_MIXES):
            qpos = clip.qpos.copy()
            for name, own in _hinges_of(config, character):
                if name != start:
                    other = clips[name][rng.integers(len(clips[name]))]
                    loop = resampled(other, clip.fps).qpos[:-1, 7:]
                    row = (rng.integers(len(loop)) + np.arange(len(qpos))) % len(loop)
                    qpos[:, 7:][:, own] = loop[row][:, own]
            found.append(dataclasses.replace(clip, qpos=qpos))
    return found


def _starts(
    clips: Sequence[Clip], character: CharacterSpec, engine: Engine, most: int
) -> tuple[Starts, np.ndarray]:
    """Every frame of clips at the control rate that has enough before it; at most `most`.

    Also what follows each of them, see `BuiltComposite`.
    """
    qpos, qvel, rows, ends, count = [], [], [], [], 0
    for moving in clips:
        qvel.append(velocities(moving, character))
        qpos.append(moving.qpos[:-1])
        rows.append(count + np.arange(FRAMES, len(qpos[-1])))
        count += len(qpos[-1])
        ends.append(np.full(len(rows[-1]), count))
    chosen, end = np.concatenate(rows), np.concatenate(ends)
    kept = np.linspace(0, len(chosen) - 1, min(most, len(chosen))).astype(int)
    chosen, end = chosen[kept], end[kept]
    places = np.concatenate(qpos)
    physics = engine.place(places, np.concatenate(qvel))
    frames = link_state(physics.kinematics)
    before = chosen[:, None] + np.arange(-FRAMES, 1)
    after = chosen[:, None] + np.arange(1, FOLLOWING + 1)
    following = places[np.minimum(after, len(places) - 1), 7:]
    following[after >= end[:, None]] = np.nan
    return Starts(physics=take(physics, jnp.asarray(chosen)), history=frames[before]), following


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
