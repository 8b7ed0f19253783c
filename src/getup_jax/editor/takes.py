"""The part of a motion that is exported, at the rate that is asked for."""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from getup_jax.editor.simulate import Motion
from getup_jax.motion.clips import MotionError

RATES = (24, 25, 30, 60)  # frames/s


@dataclasses.dataclass(frozen=True)
class Cut:
    """Which part of a motion, and how it is sampled."""

    rate: int | None = None  # frames/s; None: that of the control
    begin_s: float = 0.0
    end_s: float | None = None  # None: the motion's end
    turn: bool = False  # a film's camera goes once around the body


WHOLE = Cut()


def take(motion: Motion, cut: Cut = WHOLE) -> tuple[float, np.ndarray]:
    """Frames/s and poses [F, 7 + J] of a part of a motion; the first is at the part's beginning.

    The start pose is the motion's pose at 0 s. Positions and hinges are interpolated linearly, the
    root's rotation the short way. Raises MotionError where the part has no two frames.
    """
    poses = np.concatenate([motion.start_pose[None], motion.frames.qpos]).astype(np.float64)
    known = np.arange(len(poses)) * motion.control_dt
    fps = 1.0 / motion.control_dt if cut.rate is None else float(cut.rate)
    begin = min(max(cut.begin_s, 0.0), known[-1])
    end = known[-1] if cut.end_s is None else min(cut.end_s, known[-1])
    count = int((end - begin) * fps + 1e-6) + 1
    if count < 2:
        raise MotionError(
            f"{motion.curve.name}: expected a part of at least two frames, got {begin:g} s to "
            f"{end:g} s; move in or out"
        )
    return fps, _at(poses, known, begin + np.arange(count) / fps)


def _at(poses: np.ndarray, known: np.ndarray, times: np.ndarray) -> np.ndarray:
    times = np.minimum(times, known[-1])
    found = np.stack([np.interp(times, known, column) for column in poses.T], axis=1)
    turns = Slerp(known, Rotation.from_quat(poses[:, 3:7], scalar_first=True))(times)
    found[:, 3:7] = turns.as_quat(scalar_first=True)
    return found
