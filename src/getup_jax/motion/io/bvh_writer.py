"""Recordings as BVH files, which animation software reads: Y up, centimetres, Z-Y-X."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from getup_jax.core.output_file import write_text
from getup_jax.motion.io.bvh import Y_UP
from getup_jax.motion.io.recording import Recording, scaled, turned

_POSITION = "Xposition Yposition Zposition"
_ROTATION = "Zrotation Yrotation Xrotation"
_CENTIMETRES = 100.0


def write_bvh(recording: Recording, path: str | Path) -> None:
    """Write a recording (Z up, metres); `read_bvh` gives the same motion back.

    Inner joints get position channels only where they move in their parent's frame.
    """
    file = scaled(turned(recording, Y_UP.inv()), _CENTIMETRES)
    moving = [
        joint == 0 or not np.allclose(file.translations[:, joint], file.offsets[joint], atol=1e-6)
        for joint in range(len(file.joint_names))
    ]
    order: list[int] = []
    lines = ["HIERARCHY", *_joint_lines(file, 0, 0, moving, order)]
    lines += ["MOTION", f"Frames: {file.num_frames}", f"Frame Time: {1 / file.fps:.8f}"]
    lines += _rows(file, moving, order)
    write_text(path, "\n".join(lines) + "\n")


def _joint_lines(
    file: Recording, joint: int, depth: int, moving: list[bool], order: list[int]
) -> list[str]:
    """The block of a joint and of all below it; `order` collects the joints as written."""
    order.append(joint)
    pad, inner = "\t" * depth, "\t" * (depth + 1)
    channels = f"6 {_POSITION} {_ROTATION}" if moving[joint] else f"3 {_ROTATION}"
    lines = [
        f"{pad}{'ROOT' if joint == 0 else 'JOINT'} {file.joint_names[joint]}",
        f"{pad}{{",
        f"{inner}OFFSET {_numbers(file.offsets[joint])}",
        f"{inner}CHANNELS {channels}",
    ]
    children = [child for child, parent in enumerate(file.parents) if parent == joint]
    for child in children:
        lines += _joint_lines(file, child, depth + 1, moving, order)
    if not children:
        end = _numbers(file.ends.get(joint, np.zeros(3)))
        lines += [f"{inner}End Site", f"{inner}{{", f"{inner}\tOFFSET {end}", f"{inner}}}"]
    return [*lines, f"{pad}}}"]


def _rows(file: Recording, moving: list[bool], order: list[int]) -> list[str]:
    turns = Rotation.from_quat(file.rotations.reshape(-1, 4), scalar_first=True)
    angles = turns.as_euler("ZYX", degrees=True).reshape(*file.rotations.shape[:2], 3)
    angles = continuous_angles(angles)
    columns = []
    for joint in order:
        columns += [file.translations[:, joint]] if moving[joint] else []
        columns.append(angles[:, joint])
    return [_numbers(row) for row in np.concatenate(columns, axis=1)]


def continuous_angles(angles: np.ndarray) -> np.ndarray:
    """Euler angles [F, N, 3] (degrees, Z Y X) of the same rotations without jumps.

    Each rotation has two sets of angles, (z, y, x) and (z + 180, 180 - y, x + 180), and whole turns
    of each; the ones nearest to the frame before are taken.
    """
    found = angles.copy()
    for frame in range(1, len(found)):
        before, here = found[frame - 1], angles[frame]
        other = here * [1.0, -1.0, 1.0] + 180.0
        first, second = (near - 360.0 * np.round((near - before) / 360.0) for near in (here, other))
        farther = np.abs(first - before).sum(axis=1) > np.abs(second - before).sum(axis=1)
        found[frame] = np.where(farther[:, None], second, first)
    return found


def _numbers(values: np.ndarray) -> str:
    return " ".join(f"{value:.6f}" for value in values)
