"""The composite-motion paper's clips: JSON {fps, frames: [{body: rotation}]}.

Fifteen bodies, local rotations as quaternions xyzw, Z up, metres. The root's entry is
[[x, y, z], [quaternion]]; bodies that a frame leaves out keep the identity. The zero pose
stands facing +X with its arms down.
"""

from __future__ import annotations

import reprlib
from pathlib import Path
from typing import Any

import numpy as np

from getup_jax.motion.clips import MotionError
from getup_jax.motion.io.recording import Recording
from getup_jax.motion.io.text import LARGEST

# name, parent, place in the parent (m)
_BODIES: tuple[tuple[str, int, tuple[float, float, float]], ...] = (
    ("pelvis", -1, (0.0, 0.0, 0.0)),
    ("torso", 0, (0.0, 0.0, 0.236151)),
    ("head", 1, (0.0, 0.0, 0.223894)),
    ("right_upper_arm", 1, (-0.02405, -0.18311, 0.24350)),
    ("right_lower_arm", 3, (0.0, 0.0, -0.274788)),
    ("right_hand", 4, (0.0, 0.0, -0.258947)),
    ("left_upper_arm", 1, (-0.02405, 0.18311, 0.24350)),
    ("left_lower_arm", 6, (0.0, 0.0, -0.274788)),
    ("left_hand", 7, (0.0, 0.0, -0.258947)),
    ("right_thigh", 0, (0.0, -0.084887, 0.0)),
    ("right_shin", 9, (0.0, 0.0, -0.421546)),
    ("right_foot", 10, (0.0, 0.0, -0.40987)),
    ("left_thigh", 0, (0.0, 0.084887, 0.0)),
    ("left_shin", 12, (0.0, 0.0, -0.421546)),
    ("left_foot", 13, (0.0, 0.0, -0.40987)),
)
_FPS = (0.1, 10_000.0)
_NAMES = tuple(body[0] for body in _BODIES)


def decode(path: Path, content: dict[str, Any]) -> Recording:
    """A parsed file; MotionError names the file, the frame and the body."""
    frames, fps = content.get("frames"), content.get("fps")
    if not (isinstance(fps, int | float) and fps is not True and _FPS[0] <= fps <= _FPS[1]):
        raise MotionError(
            f"{path.name}: fps: expected a number above 0, got {reprlib.repr(fps)}; give frames a "
            f"second from {_FPS[0]:g} to {_FPS[1]:g}"
        )
    if not isinstance(frames, list) or not frames:
        raise MotionError(f"{path.name}: frames: expected a list of poses, got none")
    offsets = np.array([body[2] for body in _BODIES])
    translations = np.tile(offsets, (len(frames), 1, 1))
    rotations = np.zeros((len(frames), len(_BODIES), 4))
    rotations[..., 0] = 1.0
    for number, frame in enumerate(frames):
        where = f"{path.name}, frame {number}"
        _check_bodies(where, frame)
        for name, value in frame.items():
            if name == "pelvis":
                translations[number, 0] = _floats(where, name, value[0], 3)
                value = value[1]
            turn = _floats(where, name, value, 4)
            rotations[number, _NAMES.index(name)] = turn[[3, 0, 1, 2]] / np.linalg.norm(turn)
    return Recording(
        name=path.stem,
        fps=float(fps),
        joint_names=_NAMES,
        parents=tuple(body[1] for body in _BODIES),
        offsets=offsets,
        translations=translations,
        rotations=rotations,
        source=str(path),
    )


def _check_bodies(where: str, frame: Any) -> None:
    if not isinstance(frame, dict) or "pelvis" not in frame:
        raise MotionError(f"{where}: expected {{body: rotation}} with a pelvis")
    unknown = [name for name in frame if name not in _NAMES]
    if unknown:
        raise MotionError(
            f"{where}: unknown bodies {reprlib.repr(unknown)}; known are {', '.join(_NAMES)}"
        )
    root = frame["pelvis"]
    if not isinstance(root, list) or len(root) != 2:
        got = reprlib.repr(root)
        raise MotionError(f"{where}, pelvis: expected [[x, y, z], [quaternion]], got {got}")


def _floats(where: str, name: str, value: Any, count: int) -> np.ndarray:
    """`count` finite numbers that are not all zero where they are a rotation."""
    try:
        numbers = np.array(value, np.float64)
    except (TypeError, ValueError, OverflowError):
        numbers = np.array(np.nan)
    if numbers.shape != (count,) or not (np.abs(numbers) <= LARGEST).all():
        got = reprlib.repr(value)
        raise MotionError(f"{where}, {name}: expected {count} finite numbers, got {got}")
    if count == 4 and np.linalg.norm(numbers) < 1e-6:
        raise MotionError(f"{where}, {name}: expected a rotation, got a zero quaternion")
    return numbers
