"""BVH files: any channel order, positions on inner joints, End Sites.

The hierarchy comes first, then one row of channel values (degrees, file units) a frame.
Rotations apply in the order in which the channels are listed, the first one outermost.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from getup_jax.motion.clips import MotionError
from getup_jax.motion.io.bvh_header import Joint, read_hierarchy
from getup_jax.motion.io.bvh_rows import read_rows, read_timing
from getup_jax.motion.io.recording import Recording, scaled, turned
from getup_jax.motion.io.text import read_lines
from getup_jax.motion.retarget.up_axis import vertical_axis

Y_UP = Rotation.from_euler("x", 90, degrees=True)  # file axes (Y up) to ours (Z up)
_MOST_POSES = 20_000_000  # frames times joints
_DISPLACED = 0.05  # position channels of less than this share of the OFFSETs add to them
_STEADY = 0.2  # a joint that moves by less than this share of its distance is at a bone's end


@dataclasses.dataclass(frozen=True)
class BvhOptions:
    """How to read what a BVH file does not say."""

    metres: float | None = None  # size of the file's unit; None: from the leg length
    up: str = "auto"  # y | z, the file's vertical axis; auto: along its skeleton, else y
    allow_short: bool = False  # take files that lack many rows, or have more than the header says
    fps: float | None = None  # in place of the file's frame time


def read_bvh(path: str | Path, options: BvhOptions = BvhOptions()) -> Recording:
    """The motion of a BVH file; MotionError names the file, the line and the joint."""
    path = Path(path)
    lines = read_lines(path)
    joints, last = read_hierarchy(path.name, lines)
    timing = read_timing(path.name, lines, last, options.fps)
    frames = min(timing.frames or len(lines), len(lines) - timing.last_line)
    if frames * len(joints) > _MOST_POSES:
        raise MotionError(
            f"{path.name}: {frames:,} frames of {len(joints):,} joints are too much at once; cut "
            "the file"
        )
    rows, warnings = read_rows(path.name, joints, timing, lines, options.allow_short)
    raw = _decode(path, joints, rows, 1.0 / timing.frame_time).warn(*warnings)
    return scaled(_upright(raw, options.up), options.metres or 1.0)


def _upright(raw: Recording, asked: str) -> Recording:
    """The recording with z up; its vertical axis is y or z as asked for, else as the file shows."""
    up = vertical_axis(raw) if asked == "auto" else asked
    if up is None:
        up = "y"
        raw = raw.warn("neither bones nor motion show which axis is vertical: y; or give --up z")
    if up not in ("y", "z"):
        raise MotionError(
            f"{raw.name}: the body stands along {up}, expected y or z; export it with Y up, or "
            "give --up y or --up z if that is wrong"
        )
    return turned(raw, Y_UP) if up == "y" else raw


def _decode(path: Path, joints: Sequence[Joint], rows: np.ndarray, fps: float) -> Recording:
    """Channel values to local translations and rotations, in file axes and units."""
    count, frames = len(joints), len(rows)
    offsets = np.array([joint.offset for joint in joints])
    translations = np.tile(offsets, (frames, 1, 1))
    rotations = np.zeros((frames, count, 4))
    rotations[..., 0] = 1.0
    column = 0
    for index, joint in enumerate(joints):
        values = rows[:, column : column + len(joint.channels)]
        column += len(joint.channels)
        for k, channel in enumerate(joint.channels):
            if channel.endswith("position"):
                translations[:, index, "XYZ".index(channel[0])] = values[:, k]
        turns = [k for k, channel in enumerate(joint.channels) if channel.endswith("rotation")]
        if turns:
            order = "".join(joint.channels[k][0] for k in turns)
            turn = Rotation.from_euler(order, values[:, turns], degrees=True)
            rotations[:, index] = turn.as_quat(scalar_first=True)
    recording = Recording(
        name=path.stem,
        fps=fps,
        joint_names=tuple(joint.name for joint in joints),
        parents=tuple(joint.parent for joint in joints),
        offsets=offsets,
        translations=translations,
        rotations=rotations,
        ends={i: np.array(j.end) for i, j in enumerate(joints) if j.end is not None},
        source=str(path),
    )
    return _placed(recording, joints)


def _placed(recording: Recording, joints: Sequence[Joint]) -> Recording:
    """The places of inner joints that have position channels.

    By the format they stand in place of the OFFSET. Where a file has no OFFSETs, they are the
    bones. Where they are next to nothing beside the OFFSETs, they were meant to add to them.
    """
    placed = [any(channel.endswith("position") for channel in j.channels) for j in joints]
    if not any(placed):
        return recording.warn("no joint has position channels: the body turns about one place")
    inner = [i for i, joint in enumerate(joints) if placed[i] and joint.parent >= 0]
    if not inner:
        return recording
    offsets, translations = recording.offsets.copy(), recording.translations.copy()
    typical = np.median(translations[:, inner], axis=0)
    length, moved = (np.linalg.norm(place, axis=-1) for place in (offsets[inner], typical))
    wander = np.linalg.norm(translations[:, inner] - typical, axis=-1).max(axis=0)
    known = length > 0
    collapsed = known & (np.maximum(moved, wander) < _DISPLACED * length)
    if collapsed.sum() > 0.8 * known.sum():
        shifted = [joint for joint, is_one in zip(inner, collapsed, strict=True) if is_one]
        translations[:, shifted] += offsets[shifted]
        names = ", ".join(joints[joint].name for joint in shifted[:3])
        more = " and others" if len(shifted) > 3 else ""
        recording = recording.warn(
            f"the position channels of {names}{more} are nothing beside their OFFSETs, so they "
            "are taken to add to them"
        )
    for k, joint in enumerate(inner):
        if not known[k] and wander[k] < _STEADY * moved[k]:
            offsets[joint] = typical[k]
    return dataclasses.replace(recording, offsets=offsets, translations=translations)
