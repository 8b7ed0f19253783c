"""DeepMimic motion files: JSON {Loop, Frames} with 44 columns a frame.

Columns: duration (s), root position (Y up, m), root quaternion, then per joint a quaternion
(wxyz) or, for knees and elbows, one angle about Z. The skeleton is DeepMimic's humanoid3d:
in the zero pose it stands facing +X with its arms down, its right side at +Z.
"""

from __future__ import annotations

import reprlib
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from getup_jax.motion.clips import MotionError
from getup_jax.motion.io.bvh import Y_UP
from getup_jax.motion.io.recording import Recording, at_times, even_times, turned
from getup_jax.motion.io.text import FINITE, LARGEST, read_json

COLUMNS = 44
_DURATION_S = (1e-4, 10.0)  # of a frame, but for the last
_LEAST_NORM = 1e-6
# name, parent, place in the parent (m), columns: 4 for a quaternion, 1 for a hinge angle
_JOINTS: tuple[tuple[str, int, tuple[float, float, float], int], ...] = (
    ("root", -1, (0.0, 0.0, 0.0), 4),
    ("chest", 0, (0.0, 0.236151, 0.0), 4),
    ("neck", 1, (0.0, 0.223894, 0.0), 4),
    ("right_hip", 0, (0.0, 0.0, 0.084887), 4),
    ("right_knee", 3, (0.0, -0.421546, 0.0), 1),
    ("right_ankle", 4, (0.0, -0.40987, 0.0), 4),
    ("right_shoulder", 1, (-0.02405, 0.24350, 0.18311), 4),
    ("right_elbow", 6, (0.0, -0.274788, 0.0), 1),
    ("left_hip", 0, (0.0, 0.0, -0.084887), 4),
    ("left_knee", 8, (0.0, -0.421546, 0.0), 1),
    ("left_ankle", 9, (0.0, -0.40987, 0.0), 4),
    ("left_shoulder", 1, (-0.02405, 0.24350, -0.18311), 4),
    ("left_elbow", 11, (0.0, -0.274788, 0.0), 1),
)
_WRIST = (0.0, -0.258947, 0.0)


def read_deepmimic(path: str | Path) -> Recording:
    """The motion of a DeepMimic file at the rate of its first frame."""
    path = Path(path)
    return decode(path, read_json(path))


def decode(path: Path, content: Any) -> Recording:
    """A parsed file, {Loop, Frames}."""
    rows = content.get("Frames") if isinstance(content, dict) else None
    if not isinstance(rows, list) or not rows:
        raise MotionError(f"{path.name}: expected {{Loop, Frames}} with at least one frame")
    for number, row in enumerate(rows):
        if not isinstance(row, list) or len(row) != COLUMNS:
            got = len(row) if isinstance(row, list) else type(row).__name__
            raise MotionError(f"{path.name}, frame {number}: expected {COLUMNS} values, got {got}")
    values = _numbers(path, rows)
    durations = values[:-1, 0]
    bad = np.flatnonzero((durations < _DURATION_S[0]) | (durations > _DURATION_S[1]))
    if len(bad):
        raise MotionError(
            f"{path.name}, frame {bad[0]}: expected a duration above 0 s, from {_DURATION_S[0]:g} "
            f"to {_DURATION_S[1]:g} s, got {durations[bad[0]]:g}"
        )
    return _recording(path, values)


def _numbers(path: Path, rows: list[list[Any]]) -> np.ndarray:
    for number, row in enumerate(rows):
        for column, value in enumerate(row):
            real = isinstance(value, int | float) and not isinstance(value, bool)
            if not real or not abs(value) <= LARGEST:
                raise MotionError(
                    f"{path.name}, frame {number}, column {column}: expected {FINITE}, "
                    f"got {reprlib.repr(value)}"
                )
    return np.array(rows, np.float64)


def _recording(path: Path, values: np.ndarray) -> Recording:
    frames, count = len(values), len(_JOINTS)
    rotations, column = np.empty((frames, count, 4)), 4
    for joint, (*_, width) in enumerate(_JOINTS):
        part = values[:, column : column + width]
        rotations[:, joint] = part if width == 4 else _about_z(part[:, 0])
        column += width
    length = np.linalg.norm(rotations, axis=-1, keepdims=True)
    if length.min() < _LEAST_NORM:
        frame, joint = np.argwhere(length[..., 0] < _LEAST_NORM)[0]
        raise MotionError(
            f"{path.name}, frame {frame}, joint {_JOINTS[joint][0]}: expected a rotation, got a "
            "zero quaternion"
        )
    rotations /= length
    offsets = np.array([joint[2] for joint in _JOINTS])
    translations = np.tile(offsets, (frames, 1, 1))
    translations[:, 0] = values[:, 1:4]
    names = tuple(joint[0] for joint in _JOINTS)
    raw = Recording(
        name=path.stem,
        fps=1.0 / values[0, 0] if values[0, 0] > 0 else 30.0,
        joint_names=names,
        parents=tuple(joint[1] for joint in _JOINTS),
        offsets=offsets,
        translations=translations,
        rotations=rotations,
        ends={names.index(f"{side}_elbow"): np.array(_WRIST) for side in ("left", "right")},
        source=str(path),
    )
    return turned(_even(raw, values[:, 0]), Y_UP)


def _even(recording: Recording, durations: np.ndarray) -> Recording:
    """Frames of unequal duration at one rate."""
    if len(durations) < 3 or np.ptp(durations[:-1]) < 1e-3 * durations[0]:
        return recording
    times = np.concatenate([[0.0], np.cumsum(durations[:-1])])
    fps = 1.0 / float(np.median(durations[:-1]))
    return at_times(recording, times, even_times(recording.name, float(times[-1]), fps), fps)


def _about_z(angle: np.ndarray) -> np.ndarray:
    zero = np.zeros_like(angle)
    return Rotation.from_rotvec(np.stack([zero, zero, angle], axis=-1)).as_quat(scalar_first=True)
