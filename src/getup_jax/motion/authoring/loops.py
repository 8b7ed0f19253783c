"""Clips that end in the pose they begin with: loops, and how to play them again and again."""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np

from getup_jax.motion.clips import Clip

_LOOP_RAD = 0.05  # a clip whose first and last pose differ by less repeats
_LOOP_M = 0.02


def is_loop(clip: Clip) -> bool:
    """Whether a clip ends in its first pose, wherever that is on the floor."""
    first, last = clip.qpos[0], clip.qpos[-1]
    same = np.abs(first[7:] - last[7:]).max() < _LOOP_RAD and abs(first[2] - last[2]) < _LOOP_M
    return bool(same and clip.duration > 0)


def repeated(clip: Clip, times: int) -> Clip:
    """A loop played so many times, each from where the last one ended; other clips as they are."""
    if not is_loop(clip):
        return clip
    first, last = clip.qpos[0], clip.qpos[-1]
    turn, moved = np.zeros(4), np.zeros(3)
    mujoco.mju_negQuat(turn, first[3:7])
    mujoco.mju_mulQuat(turn, last[3:7].copy(), turn.copy())
    turn = _about_z(turn)
    rounds = [clip.qpos[1:]]
    origin = first[:3]
    for _ in range(times - 1):
        start, again = rounds[-1][-1][:3], rounds[-1].copy()
        for row in again:
            mujoco.mju_rotVecQuat(moved, row[:3] - origin, turn)
            row[:3] = start + moved
            mujoco.mju_mulQuat(row[3:7], turn, row[3:7].copy())
        origin = start
        rounds.append(again)
    return dataclasses.replace(clip, qpos=np.concatenate([clip.qpos[:1], *rounds]))


def _about_z(q: np.ndarray) -> np.ndarray:
    """The twist of q about the vertical."""
    twist = np.array([q[0], 0.0, 0.0, q[3]])
    norm = np.linalg.norm(twist)
    return twist / norm if norm > 1e-6 else np.array([1.0, 0.0, 0.0, 0.0])
