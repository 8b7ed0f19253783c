"""The HIERARCHY part of BVH files, with errors that name file, line and joint."""

from __future__ import annotations

import dataclasses
import difflib
from pathlib import Path

import numpy as np

from getup_jax.motion.clips import MotionError

CHANNELS = tuple(f"{axis}{kind}" for kind in ("position", "rotation") for axis in "XYZ")


@dataclasses.dataclass
class Joint:
    """One joint as the file describes it, in file units."""

    name: str
    parent: int
    offset: tuple[float, ...] = (0.0, 0.0, 0.0)
    channels: tuple[str, ...] = ()
    end: tuple[float, ...] | None = None  # the offset of its End Site


@dataclasses.dataclass(frozen=True)
class Header:
    """All that comes before the rows."""

    joints: list[Joint]
    frames: int
    frame_time: float  # s
    last_line: int  # 1-based line number of `Frame Time`

    @property
    def channels(self) -> int:
        """Values in a row."""
        return sum(len(joint.channels) for joint in self.joints)


def read_header(path: Path, lines: list[str]) -> Header:
    """Parse up to and with the line `Frame Time`."""
    if not lines or lines[0].strip().upper() != "HIERARCHY":
        first = lines[0].strip()[:40] if lines else "an empty file"
        raise MotionError(f"{path.name}, line 1: expected HIERARCHY, got {first!r}; not a BVH file")
    parser = _Parser(path.name)
    for number, line in enumerate(lines[1:], 2):
        words = line.split()
        if words and words[0] == "MOTION":
            parser.finish(number)
            return _motion(path, parser.joints, lines, number)
        if words:
            parser.feed(number, words)
    raise MotionError(f"{path.name}: expected a MOTION section, got none; the file is cut off")


def _motion(path: Path, joints: list[Joint], lines: list[str], number: int) -> Header:
    """`Frames: n` and `Frame Time: s` after line `number`."""
    found: dict[str, tuple[int, str]] = {}
    for at, line in enumerate(lines[number:], number + 1):
        key, colon, value = line.partition(":")
        if colon:
            found[key.strip().lower()] = (at, value.strip())
        if "frame time" in found or (line.strip() and not colon):
            break
    for key in ("frames", "frame time"):
        if key not in found:
            raise MotionError(f"{path.name}, after line {number}: expected '{key.title()}:'")
    at, text = found["frames"]
    frames = _number(path.name, at, "Frames", text)
    last, text = found["frame time"]
    frame_time = _number(path.name, last, "Frame Time", text)
    if frame_time <= 0:
        raise MotionError(
            f"{path.name}, line {last}: expected a frame time above 0 s, got {text}; "
            "write 0.033333 for 30 frames a second"
        )
    if frames < 0 or frames != int(frames):
        raise MotionError(f"{path.name}, line {at}: expected a whole frame count, got {frames}")
    return Header(joints, int(frames), frame_time, last)


def _number(file: str, line: int, what: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise MotionError(f"{file}, line {line}: {what}: expected a finite number, got {text!r}")
    return value


class _Parser:
    """Feeds on one line of the hierarchy at a time."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.joints: list[Joint] = []
        self._stack: list[int] = []  # open braces: joint index, or -1 for an End Site
        self._next: int | None = None  # what the next brace opens

    def feed(self, number: int, words: list[str]) -> None:
        """One line's words."""
        key = words[0]
        if key in ("ROOT", "JOINT"):
            self._open_joint(number, " ".join(words[1:]), key)
        elif key == "End":
            self._next = -1
        elif key == "{":
            self._brace(number)
        elif key == "}":
            if not self._stack:
                self._fail(number, "a closing brace without an opening one")
            self._stack.pop()
        elif key == "OFFSET":
            self._offset(number, words[1:])
        elif key == "CHANNELS":
            self._channels(number, words[1:])
        else:
            self._fail(number, f"expected ROOT, JOINT, End Site, OFFSET or CHANNELS, got {key!r}")

    def finish(self, number: int) -> None:
        """Checks at the end of the hierarchy."""
        if self._stack:
            self._fail(number, f"{len(self._stack)} braces are still open")
        if not self.joints:
            self._fail(number, "expected at least one joint, got none")

    def _open_joint(self, number: int, name: str, key: str) -> None:
        parent = self._stack[-1] if self._stack else -1
        if key == "ROOT" and self.joints:
            self._fail(number, f"a second ROOT {name}; one skeleton a file, please")
        if key == "JOINT" and parent < 0:
            self._fail(number, f"JOINT {name} has no parent")
        if any(joint.name == name for joint in self.joints):
            self._fail(number, f"joint {name} appears twice; rename one")
        self._next = len(self.joints)
        self.joints.append(Joint(name, parent))

    def _brace(self, number: int) -> None:
        if self._next is None:
            self._fail(number, "an opening brace without ROOT, JOINT or End Site")
        else:
            self._stack.append(self._next)
            self._next = None

    def _offset(self, number: int, words: list[str]) -> None:
        values = tuple(_number(self.file, number, "OFFSET", word) for word in words)
        if len(values) != 3 or not self._stack:
            self._fail(number, f"OFFSET: expected 3 numbers inside a joint, got {len(values)}")
        if self._stack[-1] < 0:
            self.joints[self._stack[-2]].end = values
        else:
            self.joints[self._stack[-1]].offset = values

    def _channels(self, number: int, words: list[str]) -> None:
        names = tuple(words[1:])
        if not self._stack or self._stack[-1] < 0:
            self._fail(number, "CHANNELS outside a joint")
        joint = self.joints[self._stack[-1]]
        if not words or words[0] != str(len(names)):
            self._fail(number, f"joint {joint.name}: CHANNELS says {words[:1]}, lists {len(names)}")
        for name in names:
            if name not in CHANNELS:
                close = difflib.get_close_matches(name, CHANNELS, n=1)
                hint = f"; did you mean {close[0]}?" if close else ""
                self._fail(number, f"joint {joint.name}: unknown channel {name!r}{hint}")
        joint.channels = names

    def _fail(self, number: int, text: str) -> None:
        raise MotionError(f"{self.file}, line {number}: {text}")
