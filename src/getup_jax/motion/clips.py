"""Clips of motion on a character, and the get-ups cut out of them."""

from __future__ import annotations

import dataclasses

import numpy as np


class MotionError(ValueError):
    """A motion file cannot be read or used; the text names the file, the place and the cure."""


@dataclasses.dataclass(frozen=True, eq=False)
class Clip:
    """A motion of one character at a constant rate."""

    name: str
    fps: float
    qpos: np.ndarray  # [F, 7 + J] root position (m), root quaternion (wxyz), hinges (rad)
    source: str = ""  # the file or collection that it came from

    @property
    def duration(self) -> float:
        """Seconds from the first to the last frame."""
        return (len(self.qpos) - 1) / self.fps


@dataclasses.dataclass(frozen=True, eq=False)
class GetUp:
    """A style to train on: three curves over a duration, and the motion they came from."""

    name: str
    duration: float  # s, T of equation 1
    points: np.ndarray  # [9, 3] control points of height (m), side and front angle (rad)
    clip: Clip | None = None  # the reference motion, lying first; None: curves alone
    strategy: str = ""  # class of Bohannon and Lusardi
    fit_error: np.ndarray | None = None  # [3] rms of the fit (m, rad, rad)


def continuous_signs(quaternions: np.ndarray) -> np.ndarray:
    """Signs [K, 1] that keep each quaternion on the side of the one before."""
    dots = np.sum(quaternions[1:] * quaternions[:-1], axis=1)
    return np.cumprod(np.concatenate([[1.0], np.where(dots < 0, -1.0, 1.0)]))[:, None]
