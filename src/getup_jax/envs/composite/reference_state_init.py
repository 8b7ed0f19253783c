"""Start states of composite motion along clips, and what follows each of them."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence

import jax.numpy as jnp
import numpy as np

from getup_jax.config import CompositeConfig
from getup_jax.core.types import Engine, take
from getup_jax.envs.composite.groups import resolve_groups
from getup_jax.envs.composite.link_frames import FRAMES, link_state
from getup_jax.envs.composite.task import Starts
from getup_jax.envs.getup.references import velocities
from getup_jax.motion.clips import Clip
from getup_jax.physics.character import CharacterSpec

FOLLOWING = 32  # frames after a start that are kept
_MIXES = 8  # starts of every frame of the start group's clips

# A clip as it is and bent along arcs, as many frames each, the same step in each frame.
Family = Sequence[Clip]


@dataclasses.dataclass(frozen=True, eq=False)
class Following:
    """How the clips go on after each of P starts, along each of V arcs from there."""

    angles: np.ndarray  # [P, V, FOLLOWING, J] hinges (rad) of the next frames; NaN: past the end
    turns: np.ndarray  # [V] rad/s, positive to the left


def families(clips: Sequence[Clip], turns: Sequence[float]) -> list[list[Clip]]:
    """A group's clips, which are in the order of `build_composite.load_clips`, by their origin."""
    return [list(clips[i : i + len(turns)]) for i in range(0, len(clips), len(turns))]


def mixed(
    moving: Sequence[Family],
    start: str,
    config: CompositeConfig,
    character: CharacterSpec,
    clips: dict[str, list[Clip]],
) -> list[Family]:
    """The start group's clips, each _MIXES times with the other groups' hinges from their clips.

    These begin anywhere; all are at the same rate. Otherwise an arm starts where the clip of the
    legs has it, and episodes begin with a motion that no clip of the arm has.
    """
    rng = np.random.default_rng(0)
    found = []
    for family in moving:
        for _ in range(_MIXES):
            poses = [clip.qpos.copy() for clip in family]
            for name, own in hinges_of(config, character):
                if name != start:
                    other = clips[name][rng.integers(len(clips[name]))]
                    loop = resampled(other, family[0].fps).qpos[:-1, 7:]
                    row = (rng.integers(len(loop)) + np.arange(len(poses[0]))) % len(loop)
                    for qpos in poses:
                        qpos[:, 7:][:, own] = loop[row][:, own]
            found.append(
                [dataclasses.replace(c, qpos=q) for c, q in zip(family, poses, strict=True)]
            )
    return found


def repeated_as(found: Sequence[Family], moving: Sequence[Family]) -> list[Family]:
    """The families that those of `mixed` were made of, each as often."""
    times = len(found) // len(moving)
    return [family for family in moving for _ in range(times)]


def hinges_of(
    config: CompositeConfig, character: CharacterSpec
) -> Iterator[tuple[str, np.ndarray]]:
    """Of every group: its name and its hinges [J] bool; of two with one link the first is last."""
    for group in reversed(resolve_groups(config, character)):
        yield group.name, np.isin(character.joint_link, group.links)


def reference_states(
    moving: Sequence[Family],
    turns: Sequence[float],
    character: CharacterSpec,
    engine: Engine,
    most: int,
    after: Sequence[Family] | None = None,
) -> tuple[Starts, Following]:
    """Every frame of clips at the control rate that has enough before it; at most `most`.

    after: the same clips, with other hinges, that follow the starts; None: those they are on.
    """
    clips = [clip for family in moving for clip in family]
    frames = np.concatenate([clip.qpos[:-1] for clip in clips])
    physics = engine.place(frames, np.concatenate([velocities(clip, character) for clip in clips]))
    lengths = np.array([len(clip.qpos) - 1 for clip in clips])
    firsts = np.cumsum([0, *lengths[:-1]])
    clip = np.repeat(np.arange(len(clips)), lengths)
    frame = np.arange(len(frames)) - firsts[clip]
    rows = np.flatnonzero(frame >= FRAMES)
    rows = rows[np.linspace(0, len(rows) - 1, min(most, len(rows))).astype(int)]

    before = rows[:, None] + np.arange(-FRAMES, 1)
    history = link_state(physics.kinematics)[before]

    relatives = clip[rows, None] // len(turns) * len(turns) + np.arange(len(turns))  # [P, V]
    ahead = frame[rows, None, None] + np.arange(1, FOLLOWING + 1)  # [P, 1, K]
    length = lengths[relatives][..., None]
    if after is not None:
        frames = np.concatenate([clip.qpos[:-1] for family in after for clip in family])
    angles = frames[firsts[relatives][..., None] + np.minimum(ahead, length - 1), 7:]
    angles[np.broadcast_to(ahead >= length, angles.shape[:-1])] = np.nan
    starts = Starts(physics=take(physics, jnp.asarray(rows)), history=history)
    return starts, Following(angles, np.asarray(turns, float))


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
