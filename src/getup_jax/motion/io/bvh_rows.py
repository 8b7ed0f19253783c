"""The MOTION part of BVH files: how many frames, how long each, and their rows of numbers."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Sequence

import numpy as np

from getup_jax.motion.clips import MotionError
from getup_jax.motion.io.bvh_header import Joint, number_of, without_comment
from getup_jax.motion.io.text import FINITE, LARGEST, number, said

OFF_BY_ONE = 1  # rows that a writer may forget: a file that lacks more has lost a part
FRAME_S = (1e-4, 1.0)  # shortest and longest frame that anything has recorded
_KEYS = {"frames": "Frames", "frametime": "Frame Time"}
_NUMBER = re.compile(r"[-+.]?\d|[-+]?(?:nan|inf)", re.IGNORECASE)
_CHARACTERS = 64  # of a number and what is around it, at most
_MOST_WRAPPED = 50_000_000  # characters of rows whose lines are not one frame each
_LINES = 100  # between MOTION and the first row, at most


@dataclasses.dataclass(frozen=True)
class Timing:
    """What stands between MOTION and the rows."""

    frames: int
    frame_time: float  # s
    last_line: int  # 1-based line number, the rows come after it


@dataclasses.dataclass(frozen=True)
class Row:
    """One line of the file with values in it."""

    line: int  # 1-based
    text: str


def read_timing(file: str, lines: Sequence[str], start: int, fps: float | None) -> Timing:
    """`Frames: n` and `Frame Time: s` after MOTION in line `start`, in any order and spelling.

    fps: the rate that holds in place of the frame time, which may then be missing or wrong.
    """
    found, last = _entries(lines, start)
    if "Frames" not in found:
        raise MotionError(f"{file}, after line {start}: expected 'Frames:' and their number")
    at, text = found["Frames"]
    if not re.fullmatch(r"\d{1,15}(\.0*)?", text):
        raise MotionError(f"{file}, line {at}: Frames: expected a whole number, got {said(text)}")
    frames = int(float(text))
    if fps is not None:
        return Timing(frames, 1.0 / fps, last)
    if "Frame Time" not in found:
        raise MotionError(
            f"{file}, after line {start}: expected 'Frame Time:' and seconds; write it, or give "
            "the file's rate with --source-fps"
        )
    return Timing(frames, _seconds(file, *found["Frame Time"]), last)


def read_rows(
    file: str, joints: Sequence[Joint], timing: Timing, lines: Sequence[str], allow_short: bool
) -> tuple[np.ndarray, list[str]]:
    """The channel values [F, C] and the warnings."""
    first = timing.last_line
    rows = [Row(n, without_comment(line)) for n, line in enumerate(lines[first:], first + 1)]
    rows = [row for row in rows if row.text and not row.text.isspace()]
    rows, warnings = _without_tail(rows, timing.frames)
    names = [f"{joint.name} {channel}" for joint in joints for channel in joint.channels]
    if not names:
        raise MotionError(f"{file}: expected joints with CHANNELS, got none")
    longest = _CHARACTERS * len(names)  # of a row as it should be
    if _is_plain(rows, len(names), longest):
        warnings += _counted(file, timing.frames, len(rows), allow_short)
        rows = rows[: timing.frames or len(rows)]
        values = _fast(rows, len(names))
    else:
        values = _wrapped(rows, len(names), min(timing.frames * longest, _MOST_WRAPPED))
        count = len(rows if values is None else values)
        warnings += _counted(file, timing.frames, count, allow_short)
    if values is None:
        raise _damage(file, names, rows)
    return values[: timing.frames or len(values)], warnings


def _is_plain(rows: Sequence[Row], width: int, longest: int) -> bool:
    """Whether each line is one frame, as far as the first one shows."""
    if not rows or any(len(row.text) > longest for row in rows):
        return False
    return len(rows[0].text.split()) == width


def _entries(lines: Sequence[str], start: int) -> tuple[dict[str, tuple[int, str]], int]:
    """{key: (line, value)} before the first row, and the line of the last one."""
    found: dict[str, tuple[int, str]] = {}
    key, last = "", start
    rest = re.split(r"\bmotion\b", lines[start - 1], maxsplit=1, flags=re.IGNORECASE)[-1]
    for at, line in enumerate([rest, *lines[start : start + _LINES]], start):
        words = without_comment(line).replace(":", " ").replace("=", " ").split()
        if words and not key and _NUMBER.match(words[0]):
            break
        key = key if key in _KEYS else ""
        for word in words:
            if key in _KEYS or (key and _NUMBER.match(word)):
                if key in _KEYS:
                    found[_KEYS[key]], last = (at, word), at
                key = ""
            else:
                key += word.lower().replace("_", "")
        if len(found) == len(_KEYS):
            break
    return found, last


def _seconds(file: str, line: int, text: str) -> float:
    """The frame time, or MotionError that says what was probably meant."""
    where, value = f"{file}, line {line}", number_of(file, line, "Frame Time", text)
    if value <= 0:
        raise MotionError(
            f"{where}: expected a frame time above 0 s, got {text}; write 0.033333 for 30 frames "
            "a second, or give the rate with --source-fps 30"
        )
    shortest, longest = FRAME_S
    if shortest <= value <= longest:
        return value
    hints = "give the file's rate with --source-fps, such as 30"
    if longest < value <= 1000:
        hints = f"milliseconds? then give --source-fps {1000 / value:.4g}"
        if value >= 10 and value == int(value):
            hints += f"; frames a second? then give --source-fps {value:g}"
    raise MotionError(f"{where}: a frame time of {text} s is not possible; {hints}")


def _without_tail(rows: list[Row], frames: int) -> tuple[list[Row], list[str]]:
    """The rows up to a word that is no number behind the last frame."""
    for index, row in enumerate(rows[frames:], frames):
        if not _NUMBER.match(row.text.lstrip()):
            text = f"line {row.line}: {said(row.text.strip())} is behind the last row"
            return rows[:index], [f"{text}, and not read, nor what follows"]
    return rows, []


def _fast(rows: Sequence[Row], width: int) -> np.ndarray | None:
    """The values of rows that are all as they should be, else None."""
    try:
        values = np.loadtxt([row.text for row in rows], ndmin=2, comments=None)
    except ValueError:
        return None
    if values.shape[1] != width:
        return None
    return values if (np.abs(values) <= LARGEST).all() else None


def _wrapped(rows: Sequence[Row], width: int, most: int) -> np.ndarray | None:
    """The values of frames that take several lines each, or share one; None for all others.

    most: characters that the rows may have in all.
    """
    if not rows or sum(len(row.text) for row in rows) > most:
        return None
    if any("_" in row.text for row in rows):  # Python reads 1_0 as 10
        return None
    words = [row.text.split() for row in rows]
    lengths = np.array([len(line) for line in words], int)
    ends = np.cumsum(lengths)
    if ends[-1] % width:
        return None
    starts_apart = np.isin(np.arange(width, ends[-1] + 1, width), ends).all()
    if not (starts_apart or (lengths % width == 0).all()):
        return None
    try:
        values = np.array([word for line in words for word in line], np.float64)
    except ValueError:
        return None
    return values.reshape(-1, width) if (np.abs(values) <= LARGEST).all() else None


def _counted(file: str, frames: int, count: int, allow_short: bool) -> list[str]:
    """The warning of a header that says another number of frames, or MotionError."""
    if not frames and not count:
        raise MotionError(f"{file}: expected at least one frame, got none; record or export again")
    if count == frames:
        return []
    text = f"header says {frames} frames, file has {count} rows"
    if not count or not (allow_short or frames - count == OFF_BY_ONE):
        hint = "fix the header" + (" or pass --allow-short" if count else "")
        raise MotionError(f"{file}: {text}; {hint}")
    return [f"{text}; {min(count, frames) or count} frames are used"]


def _damage(file: str, names: Sequence[str], rows: Sequence[Row]) -> MotionError:
    """The error of the first row with too few or too many values, or with one that is none."""
    most = 2 * len(names) + 10
    for row in rows:
        got = len(row.text.split(None, most))
        if got != len(names):
            more = "more" if got > most else got
            return MotionError(
                f"{file}, line {row.line}: expected {len(names)} values, one a channel, got "
                f"{more}; the row is damaged"
            )
    for row in rows:
        for name, word in zip(names, row.text.split(), strict=True):
            if number(word) is None:
                return MotionError(
                    f"{file}, line {row.line}, joint {name}: expected {FINITE}, got "
                    f"{said(word)}; mend or remove that frame"
                )
    return MotionError(f"{file}: expected finite numbers in every row")
