"""BVH files: any channel order, positions on inner joints, End Sites.

The hierarchy comes first, then one row of channel values (degrees, file units) a frame.
Rotations apply in the order in which the channels are listed, the first one outermost.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from getup_jax.motion.bvh_header import Header, read_header
from getup_jax.motion.clips import MotionError
from getup_jax.motion.skeleton import Recording, scaled, turned

Y_UP = Rotation.from_euler("x", 90, degrees=True)  # file axes (Y up) to ours (Z up)
OFF_BY_ONE = 1  # rows that a writer may forget: a file that lacks more has lost a part


@dataclasses.dataclass(frozen=True)
class BvhOptions:
    """How to read what a BVH file does not say."""

    metres: float | None = None  # size of the file's unit; None: from the leg length
    up: str = "y"  # y | z, the file's vertical axis
    allow_short: bool = False  # take files that lack many rows, or have more than the header says


def read_bvh(path: str | Path, options: BvhOptions = BvhOptions()) -> Recording:
    """The motion of a BVH file; MotionError names the file, the line and the joint."""
    path = Path(path)
    lines = _lines(path)
    header = read_header(path, lines)
    rows, warnings = _rows(path, header, lines, options.allow_short)
    raw = _decode(path, header, rows)
    recording = turned(raw, Y_UP) if options.up == "y" else raw
    return scaled(recording, options.metres or 1.0).warn(*warnings)


def _lines(path: Path) -> list[str]:
    try:
        return path.read_text(encoding="utf-8", errors="strict").splitlines()
    except OSError as error:
        raise MotionError(f"{path}: cannot be read: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise MotionError(f"{path}: expected a BVH text file, got binary data") from None


def _rows(
    path: Path, header: Header, lines: list[str], allow_short: bool
) -> tuple[np.ndarray, list[str]]:
    """The channel values [F, C] and the warnings."""
    found = [(number, line) for number, line in enumerate(lines, 1) if number > header.last_line]
    found = [(number, line.split()) for number, line in found if line.strip()]
    warnings = []
    if len(found) != header.frames:
        counts = f"header says {header.frames} frames, file has {len(found)} rows"
        tolerated = allow_short or header.frames - len(found) == OFF_BY_ONE
        if not tolerated or not found:
            hint = "fix the header" + (" or pass --allow-short" if found else "")
            raise MotionError(f"{path.name}: {counts}; {hint}")
        warnings.append(f"{counts}; {min(len(found), header.frames)} frames are used")
        found = found[: header.frames] if header.frames else found
    for number, row in found:
        if len(row) != header.channels:
            raise MotionError(
                f"{path.name}, line {number}: expected {header.channels} values, one a channel, "
                f"got {len(row)}; the row is damaged"
            )
    try:
        values = np.array([row for _, row in found], dtype=np.float64)
    except ValueError:
        values = None
    if values is None or not np.isfinite(values).all():
        raise _bad_value(path, header, found)
    return values, warnings


def _bad_value(path: Path, header: Header, rows: list[tuple[int, list[str]]]) -> MotionError:
    """The error for the first entry that is not a finite number."""
    names = [f"{j.name} {channel}" for j in header.joints for channel in j.channels]
    for number, row in rows:
        for name, text in zip(names, row, strict=True):
            if not _is_finite(text):
                return MotionError(
                    f"{path.name}, line {number}, joint {name}: expected a finite number, "
                    f"got {text!r}; mend or remove that frame"
                )
    return MotionError(f"{path.name}: expected finite numbers in every row")


def _is_finite(text: str) -> bool:
    try:
        return bool(np.isfinite(float(text)))
    except ValueError:
        return False


def _decode(path: Path, header: Header, rows: np.ndarray) -> Recording:
    """Channel values to local translations and rotations, in file axes and units."""
    count, frames = len(header.joints), len(rows)
    offsets = np.array([joint.offset for joint in header.joints])
    translations = np.tile(offsets, (frames, 1, 1))
    rotations = np.zeros((frames, count, 4))
    rotations[..., 0] = 1.0
    column = 0
    for index, joint in enumerate(header.joints):
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
    return Recording(
        name=path.stem,
        fps=1.0 / header.frame_time,
        joint_names=tuple(joint.name for joint in header.joints),
        parents=tuple(joint.parent for joint in header.joints),
        offsets=offsets,
        translations=translations,
        rotations=rotations,
        ends={i: np.array(j.end) for i, j in enumerate(header.joints) if j.end is not None},
        source=str(path),
    )
