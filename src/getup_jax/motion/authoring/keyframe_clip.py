"""From keyframes to a clip: smooth in time, contacts planted, the lowest geom on the floor.

In the air the centre of mass follows its parabola instead.
"""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
from scipy.interpolate import PchipInterpolator

from getup_jax.motion.authoring.contact_ik import Planter
from getup_jax.motion.authoring.keyframe_file import Keyframe, KeyframeMotion
from getup_jax.motion.clips import Clip, continuous_signs
from getup_jax.physics.character import CharacterSpec

_GRAVITY = 9.81  # m/s^2


def clip_from_keyframes(
    motion: KeyframeMotion, character: CharacterSpec, fps: float = 30.0
) -> Clip:
    """Sample a motion at a constant rate.

    Monotone cubic interpolation neither overshoots a keyframe nor passes a joint limit; whole-
    body inverse kinematics then holds the planted contacts where the keyframes have them.
    """
    count = round(motion.duration * fps) + 1
    times = np.linspace(0.0, motion.duration, count)
    keys = motion.keyframes
    qpos = _interpolate_loop(keys, times) if motion.loop else _interpolate(keys, times)
    planter = Planter(character)
    for first, second in itertools.pairwise(keys):
        inside = np.flatnonzero((times >= first.time) & (times <= second.time))
        qpos[inside] = _plant(qpos[inside], times[inside], (first, second), planter)
    flights = _flights(keys)
    flying = np.any([(times > a) & (times < b) for a, b in flights] or [np.zeros(count, bool)], 0)
    qpos = np.stack(
        [q if f else planter.rest_on_floor(q) for q, f in zip(qpos, flying, strict=True)]
    )
    for start, end in flights:
        _fly(qpos, times, (start, end), planter)
    return Clip(name=motion.name, fps=(count - 1) / motion.duration, qpos=qpos, source="authored")


def _interpolate(keys: tuple[Keyframe, ...], times: np.ndarray) -> np.ndarray:
    poses = np.stack([key.qpos for key in keys])
    poses[:, 3:7] *= continuous_signs(poses[:, 3:7])
    qpos = PchipInterpolator([key.time for key in keys], poses)(times)
    qpos[:, 3:7] /= np.linalg.norm(qpos[:, 3:7], axis=1, keepdims=True)
    return qpos


def _interpolate_loop(keys: tuple[Keyframe, ...], times: np.ndarray) -> np.ndarray:
    """As `_interpolate`, with the period before and the one after, so that rates close too."""
    period = keys[-1].time
    advance = keys[-1].qpos - keys[0].qpos
    rounds = [
        dataclasses.replace(key, time=key.time + k * period, qpos=key.qpos + k * advance)
        for k in (-1, 0, 1)
        for key in keys[:-1]
    ]
    last = dataclasses.replace(keys[-1], time=2 * period, qpos=keys[-1].qpos + advance)
    return _interpolate((*rounds, last), times)


def _flights(keys: tuple[Keyframe, ...]) -> list[tuple[float, float]]:
    """Start and end (s) of every time in the air; neighbouring ones are one."""
    spans: list[tuple[float, float]] = []
    for first, second in itertools.pairwise(keys):
        if first.airborne:
            joined = bool(spans) and spans[-1][1] == first.time
            start = spans.pop()[0] if joined else first.time
            spans.append((start, second.time))
    return spans


def _fly(qpos: np.ndarray, times: np.ndarray, span: tuple[float, float], planter: Planter) -> None:
    """Move the frames of a flight so that the centre of mass falls freely between its ends."""
    start, end = (int(np.argmin(np.abs(times - t))) for t in span)
    inside = np.arange(start, end + 1)
    share = (times[inside] - times[start]) / (times[end] - times[start])
    centres = np.stack([planter.centre_of_mass(qpos[i]) for i in inside])
    path = centres[0] + share[:, None] * (centres[-1] - centres[0])
    path[:, 2] += 0.5 * _GRAVITY * (times[inside] - times[start]) * (times[end] - times[inside])
    qpos[inside, :3] += path - centres


def _plant(
    qpos: np.ndarray, times: np.ndarray, keys: tuple[Keyframe, Keyframe], planter: Planter
) -> np.ndarray:
    """Hold the contacts that the first keyframe plants; what the second misses by is spread."""
    first, second = keys
    names = first.planted
    if not names:
        return qpos
    start, end = (planter.poses(key.qpos, names) for key in keys)
    share = (times - first.time) / (second.time - first.time)
    share = share * share * (3.0 - 2.0 * share)
    planted = []
    for pose, s in zip(qpos, share, strict=True):
        targets = {name: (1.0 - s) * start[name] + s * end[name] for name in names}
        planted.append(planter.solve(pose, targets))
    return np.stack(planted)
