"""A get-up cut out of a clip: its curves, their fit, its strategy."""

from __future__ import annotations

import dataclasses

import numpy as np

from getup_jax.motion.clips import Clip, GetUp, MotionError
from getup_jax.motion.getup import curves
from getup_jax.motion.getup.curves import FeatureLinks, features
from getup_jax.motion.getup.events import (
    DEFAULTS,
    Event,
    EventSettings,
    find_events,
    heights_of,
    link_positions,
)
from getup_jax.motion.getup.strategies import classify
from getup_jax.physics.character import CharacterSpec

_SAMPLES = 512
FLAT_M = 0.16  # the neck is .11 m high on a body that lies flat, and .22 m with the head raised


@dataclasses.dataclass(frozen=True)
class CutSettings:
    """Where a get-up that was found by itself starts and ends."""

    lead_s: float = 0.25  # how much of the lying phase comes before the rise
    upright_s: float = 1.5  # the end waits this long at most for the body to straighten
    upright: float = 0.98  # it ends where the neck is this share of the highest in that time


_CUTS = CutSettings()


def cut_getup(
    clip: Clip, character: CharacterSpec, start: int, stand: int, name: str | None = None
) -> GetUp:
    """Frames start to stand (both included) as a get-up, named `clip:start-stand`."""
    if not 0 <= start < stand - 8 or stand >= len(clip.qpos):
        raise MotionError(
            f"{clip.name}:{start}-{stand}: expected first and last frame inside the clip's "
            f"0-{len(clip.qpos) - 1} and at least 9 frames; correct the cut"
        )
    name = name or f"{clip.name}:{start}-{stand}"
    part = Clip(name, clip.fps, clip.qpos[start : stand + 1].copy(), clip.source)
    positions = link_positions(part, character)
    points, error = curves.fit(evenly(clip_features(positions, character), _SAMPLES))
    strategy = classify(positions, part.fps, character)
    return GetUp(name, part.duration, points, part, strategy, error)


def clip_features(positions: np.ndarray, character: CharacterSpec) -> np.ndarray:
    """Height and angles [F, 3] over flat ground, of link positions [F, L, 3]."""
    return features(FeatureLinks.of(character), np.asarray(positions, np.float64), 0.0)


def evenly(values: np.ndarray, count: int) -> np.ndarray:
    """Samples [F, D] at `count` equal steps of the same duration [count, D], the ends unchanged."""
    old, new = np.linspace(0, 1, len(values)), np.linspace(0, 1, count)
    return np.stack([np.interp(new, old, column) for column in values.T], axis=1)


def flat_time(getup: GetUp) -> float:
    """Seconds for which the curve asks for a body so low that its head is on the floor."""
    height = curves.evaluate(getup.points, np.linspace(0.0, 1.0, _SAMPLES))[:, 0]
    return getup.duration * float(np.mean(height < FLAT_M))


def find_getups(
    clip: Clip,
    character: CharacterSpec,
    settings: EventSettings = DEFAULTS,
    cuts: CutSettings = _CUTS,
) -> tuple[list[Event], list[GetUp]]:
    """The events of a clip and one get-up for each."""
    positions = link_positions(clip, character)
    events = find_events(heights_of(positions, character), clip.fps, settings)
    neck = positions[:, character.link("neck"), 2]
    found = []
    for event in events:
        lead = round(cuts.lead_s * clip.fps)
        start = max(event.lie_start, event.last_flat - lead)
        found.append(cut_getup(clip, character, start, _upright(neck, event, clip.fps, cuts)))
    return events, found


def _upright(neck: np.ndarray, event: Event, fps: float, cuts: CutSettings) -> int:
    """The frame at which the rise is over: standing starts while the trunk still bends."""
    after = neck[event.stand : event.stand + round(cuts.upright_s * fps) + 1]
    return event.stand + int(np.argmax(after >= cuts.upright * after.max()))
