"""Get-ups in a clip: where it lies, when it starts to rise, when it stands.

A frame lies where head and pelvis are both low, is flat where both are very low, and stands
where both are high. A get-up goes from the first frame of a lying phase to the first standing
frame after it. All heights are shares of the character's own neutral pose, so the rules hold
for every character and every recording once it is retargeted.
"""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np

from getup_jax.motion.clips import Clip
from getup_jax.physics.character import CharacterSpec


@dataclasses.dataclass(frozen=True)
class EventSettings:
    """Heights are shares of the link's height in the neutral pose; times in seconds."""

    lie_head: float = 0.32  # lying: head below this ...
    lie_pelvis: float = 0.33  # ... and pelvis below this
    flat_head: float = 0.185  # flat on the floor, likewise
    flat_pelvis: float = 0.22
    stand_head: float = 0.81  # standing: head above this ...
    stand_pelvis: float = 0.87  # ... and pelvis above this
    gap_s: float = 2.0  # a shorter break does not end a lying phase
    min_lie_s: float = 0.1  # a shorter lying phase is none
    max_rise_s: float = 12.0  # a slower rise is not one get-up
    side_cosine: float = 0.5  # |cosine of front to up| below this: lying on the side


DEFAULTS = EventSettings()


@dataclasses.dataclass(frozen=True)
class Event:
    """One get-up; frames are 0-based."""

    lie_start: int  # first lying frame
    last_flat: int  # last frame flat on the floor: the rise starts here
    last_lying: int  # last frame with head and pelvis low
    stand: int  # first standing frame
    orientation: str  # supine | prone | side, at last_flat

    def rise_s(self, fps: float) -> float:
        """Seconds from the floor to standing."""
        return (self.stand - self.last_flat) / fps


@dataclasses.dataclass(frozen=True, eq=False)
class Heights:
    """What the rules look at, per frame."""

    head: np.ndarray  # [F] share of the neutral height
    pelvis: np.ndarray  # [F]
    front_up: np.ndarray  # [F] cosine between the front vector and up


def link_positions(clip: Clip, character: CharacterSpec) -> np.ndarray:
    """Joint centres [F, L, 3] (m) of every frame."""
    data = mujoco.MjData(character.model)
    positions = np.empty((len(clip.qpos), len(character.link_names), 3))
    for frame, qpos in enumerate(clip.qpos):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(character.model, data)
        positions[frame] = data.xpos[1:]
    return positions


def heights_of(positions: np.ndarray, character: CharacterSpec) -> Heights:
    """Heights of link positions [F, L, 3] as shares of the neutral pose's."""
    head, pelvis, neck = (character.link(name) for name in ("head", "pelvis", "neck"))
    hips = [character.link(name) for name in ("thigh_r", "thigh_l")]
    neutral = link_positions(Clip("neutral", 1.0, character.neutral_qpos[None]), character)[0]
    side = positions[:, hips[0]] - positions[:, hips[1]]
    spine = positions[:, neck] - positions[:, hips].mean(axis=1)
    front = np.cross(spine, side)
    return Heights(
        head=positions[:, head, 2] / neutral[head, 2],
        pelvis=positions[:, pelvis, 2] / neutral[pelvis, 2],
        front_up=front[:, 2] / np.maximum(np.linalg.norm(front, axis=-1), 1e-9),
    )


def find_events(
    heights: Heights,
    fps: float,
    settings: EventSettings = DEFAULTS,
) -> list[Event]:
    """The get-ups of a clip in order of time."""
    lying = lies(heights, settings)
    standing = (heights.head > settings.stand_head) & (heights.pelvis > settings.stand_pelvis)
    events = []
    for start, end in _phases(lying, standing, settings.gap_s * fps):
        after = np.flatnonzero(standing[end:])
        if not len(after) or end - start < settings.min_lie_s * fps:
            continue
        stand = int(end + after[0])
        again = np.flatnonzero(lying[end:stand])
        if len(again):  # it lay down again before it stood: a later phase is the get-up
            continue
        event = _event(heights, start, end - 1, stand, settings)
        if event.rise_s(fps) <= settings.max_rise_s:
            events.append(event)
    return events


def lies(heights: Heights, settings: EventSettings) -> np.ndarray:
    """Mask [F] of the frames with head and pelvis low."""
    return (heights.head < settings.lie_head) & (heights.pelvis < settings.lie_pelvis)


def orientation(front_up: float, settings: EventSettings = DEFAULTS) -> str:
    """supine, prone or side, by the cosine between the torso's front and up."""
    if abs(front_up) < settings.side_cosine:
        return "side"
    return "supine" if front_up > 0 else "prone"


def _phases(lying: np.ndarray, standing: np.ndarray, gap: float) -> list[tuple[int, int]]:
    """(first, last + 1) of lying phases; breaks shorter than `gap` frames are bridged."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], lying.astype(np.int8), [0]])))
    phases: list[tuple[int, int]] = []
    for start, end in edges.reshape(-1, 2).tolist():
        bridged = phases and start - phases[-1][1] <= gap
        if bridged and not standing[phases[-1][1] : start].any():
            phases[-1] = (phases[-1][0], end)
        else:
            phases.append((start, end))
    return phases


def _event(heights: Heights, start: int, last: int, stand: int, settings: EventSettings) -> Event:
    """Fill in the last flat frame: the one before head or pelvis leave the floor for good."""
    head, pelvis = heights.head[start : last + 1], heights.pelvis[start : last + 1]
    flat = np.flatnonzero((head < settings.flat_head) & (pelvis < settings.flat_pelvis))
    last_flat = start + int(flat[-1]) if len(flat) else last
    return Event(start, last_flat, last, stand, orientation(heights.front_up[last_flat], settings))
