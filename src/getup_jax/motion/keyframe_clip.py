"""From keyframes to a clip: smooth in time, contacts planted, the lowest geom on the floor."""

from __future__ import annotations

import itertools

import numpy as np
from scipy.interpolate import PchipInterpolator

from getup_jax.motion.clips import Clip
from getup_jax.motion.keyframe_file import Keyframe, KeyframeMotion
from getup_jax.motion.planting import Planter
from getup_jax.physics.character import CharacterSpec


def clip_from_keyframes(
    motion: KeyframeMotion, character: CharacterSpec, fps: float = 30.0
) -> Clip:
    """Sample a motion at a constant rate.

    Monotone cubic interpolation neither overshoots a keyframe nor passes a joint limit; whole-
    body inverse kinematics then holds the planted contacts where the keyframes have them.
    """
    count = round(motion.duration * fps) + 1
    times = np.linspace(0.0, motion.duration, count)
    qpos = _interpolate(motion.keyframes, times)
    planter = Planter(character)
    keys = motion.keyframes
    for first, second in itertools.pairwise(keys):
        inside = np.flatnonzero((times >= first.time) & (times <= second.time))
        qpos[inside] = _plant(qpos[inside], times[inside], (first, second), planter)
    qpos = np.stack([planter.rest_on_floor(q) for q in qpos])
    return Clip(name=motion.name, fps=(count - 1) / motion.duration, qpos=qpos, source="authored")


def _interpolate(keys: tuple[Keyframe, ...], times: np.ndarray) -> np.ndarray:
    poses = np.stack([key.qpos for key in keys])
    poses[:, 3:7] *= _continuous_signs(poses[:, 3:7])
    qpos = PchipInterpolator([key.time for key in keys], poses)(times)
    qpos[:, 3:7] /= np.linalg.norm(qpos[:, 3:7], axis=1, keepdims=True)
    return qpos


def _continuous_signs(quaternions: np.ndarray) -> np.ndarray:
    """Signs [K, 1] that keep each quaternion on the side of the one before."""
    dots = np.sum(quaternions[1:] * quaternions[:-1], axis=1)
    return np.cumprod(np.concatenate([[1.0], np.where(dots < 0, -1.0, 1.0)]))[:, None]


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
