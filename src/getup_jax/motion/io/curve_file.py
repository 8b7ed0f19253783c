"""Curve files: a style as a small YAML file that people read, write and edit.

    name: late_rise
    strategy: quadruped push-up
    start: prone_quadruped_squat            # a reference motion, or `mirrored` and its name
    durations: [5.1]                        # s, one get-up each
    height: [0.11, ...]                     # nine control points, m above the ground
    side_angle: [90, ...]                   # degrees, the right side to up
    front_angle: [179, ...]                 # degrees, the front to up
    pose: [0, 0, 0.1, 1, 0, 0, 0, ...]      # only where `start` is no reference motion: qpos
    region: hard                            # only where it was drawn on irregular ground: where
    place: 3

Configs (`motion.source`), `getup-eval --curves` and the curve editor take the same files.
"""

from __future__ import annotations

import dataclasses
import reprlib
import unicodedata
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from getup_jax.config import yaml_text
from getup_jax.config.yaml_text import YamlError
from getup_jax.motion.clips import Clip, GetUp, MotionError
from getup_jax.motion.getup.curves import NAMES, NUM_POINTS
from getup_jax.physics.character import CharacterSpec
from getup_jax.physics.terrain_map import REGIONS

SUFFIXES = (".yaml", ".yml")
MIRRORED = "mirrored "  # before the name of a reference motion: its mirror image
KEYS = ("name", "strategy", "start", "durations", *NAMES)
OPTIONAL = ("pose", "region", "place")
DURATION_S = (0.5, 20.0)
# Of height (m), side and front angle (degrees). The curve stays inside the hull of its points, and
# points past what a body can do bend it towards there.
LIMITS = ((-0.5, 2.5), (-90.0, 270.0), (-90.0, 270.0))
_MAX_BYTES = 64_000
_MOTIONS, _EITHER = (".bvh", ".amc", ".asf", ".npz"), (".json", ".txt")
_MAX_DURATIONS = 16
MOST_PLACES = 10_000
_MOST_LETTERS, _MARKS = 80, "_.@:~ -"  # of a name: how long it is, what is in it beside letters
_SHORT = reprlib.Repr()  # of what came instead
_SHORT.maxlevel, _SHORT.maxlist, _SHORT.maxstring = 2, 4, 100
_COMMENTS = {
    "start": "the motion whose first pose it starts from",
    "durations": "s",
    "height": "m, neck base above the ground",
    "side_angle": "degrees, the right side to up",
    "front_angle": "degrees, the front to up",
    "pose": "root position (m), root quaternion (wxyz), hinges (rad)",
    "region": "of irregular ground, in the editor alone",
    "place": "there",
}


@dataclasses.dataclass(frozen=True, eq=False)
class CurveFile:
    """One style in the units of its file, which are exact: nothing is rounded on the way."""

    name: str
    strategy: str
    start: str  # a reference motion
    durations: tuple[float, ...]  # s
    values: np.ndarray  # [9, 3] control points: m, degrees, degrees
    pose: np.ndarray | None = None  # [7 + J] the start pose itself
    ground: tuple[str, int] | None = None  # region, and place there from 1, that it was drawn in

    def getups(self, clip: Clip | None = None) -> list[GetUp]:
        """One get-up a duration, NAME@T, that starts from the clip's first pose if one is given."""
        points = self.values.copy()
        points[:, 1:] = np.radians(points[:, 1:])
        return [
            GetUp(f"{self.name}@{duration:g}", duration, points, clip, self.strategy)
            for duration in self.durations
        ]

    def start_clip(self, clips: Mapping[str, Clip], character: CharacterSpec) -> Clip:
        """The motion whose first pose is the start; a pose of the file's own stands still."""
        if self.pose is not None:
            if len(self.pose) != 7 + character.num_joints:
                raise MotionError(
                    f"{self.name}: pose: expected {7 + character.num_joints} numbers, got "
                    f"{len(self.pose)}; save it again for this character"
                )
            return Clip(self.start, 1.0, np.stack([self.pose, self.pose]))
        name = self.start.removeprefix(MIRRORED)
        if name not in clips:
            raise _unknown_start(self.name, self.start, tuple(clips))
        clip = clips[name]
        if name == self.start:
            return clip
        return dataclasses.replace(clip, name=self.start, qpos=character.mirror(clip.qpos))

    def plain(self) -> dict[str, Any]:
        """What the file says, as plain values."""
        content: dict[str, Any] = {"name": self.name, "strategy": self.strategy}
        content |= {"start": self.start, "durations": list(self.durations)}
        content |= {name: self.values[:, i].tolist() for i, name in enumerate(NAMES)}
        if self.pose is not None:
            content["pose"] = self.pose.tolist()
        if self.ground is not None:
            content["region"], content["place"] = self.ground
        return content


def read_curve_file(path: str | Path) -> CurveFile:
    """The style in a file; MotionError says what is wrong with it."""
    path = Path(path)
    try:
        large = path.stat().st_size > _MAX_BYTES
        if path.suffix.lower() in _MOTIONS or (large and path.suffix.lower() in _EITHER):
            raise MotionError(
                f"{path.name}: expected a curve file ({', '.join(SUFFIXES)}), got a motion file; "
                f"evaluate its get-ups with --motions {path}, or import it in getup-edit and save "
                "its curve"
            )
        if large:
            raise MotionError(f"{path.name}: expected at most {_MAX_BYTES} bytes")
        return parse_text(path.read_bytes(), path.name)
    except OSError as error:
        raise MotionError(f"{path}: cannot be read: {error.strerror or error}") from None


def parse_text(text: str | bytes, where: str) -> CurveFile:
    """The style in the text of a file that is called `where`."""
    if len(text) > _MAX_BYTES:
        raise MotionError(f"{where}: expected at most {_MAX_BYTES} bytes, got {len(text)}")
    if isinstance(text, bytes):
        text = text.decode("utf-8", "replace")
    try:
        content = yaml_text.parse(text)
    except YamlError as error:
        place = "" if error.line is None else f", line {error.line}"
        raise MotionError(f"{where}{place}: not a curve file: {error}") from None
    return parse(content, where)


def is_name(text: str, marks: str, most: int) -> bool:
    """Whether it has 1 to `most` letters and digits of any script, and these marks."""

    def fits(letter: str) -> bool:  # vowel signs of many scripts are combining, and no letters
        return letter.isalnum() or letter in marks or unicodedata.category(letter)[0] == "M"

    return 1 <= len(text) <= most and all(map(fits, text))


def parse(content: Any, where: str) -> CurveFile:
    """The style in the content of a file, however it came; every value is checked."""
    if not isinstance(content, Mapping) or set(content) - set(OPTIONAL) != set(KEYS):
        mapping = isinstance(content, Mapping)
        found = ", ".join(_shown(k).strip("'") for k in content) if mapping else content
        raise MotionError(f"{where}: expected the keys {', '.join(KEYS)}, got {_shown(found)}")
    for key in ("name", "strategy", "start"):
        if not isinstance(content[key], str) or not is_name(content[key], _MARKS, _MOST_LETTERS):
            raise _wrong(where, key, "up to 80 letters, digits, spaces and _-.@:~", content[key])
    durations = _numbers(content["durations"], where, "durations", DURATION_S)
    if not 1 <= len(durations) <= _MAX_DURATIONS:
        raise _wrong(where, "durations", f"1 to {_MAX_DURATIONS} numbers", content["durations"])
    values = np.empty((NUM_POINTS, len(NAMES)))
    for column, (name, limits) in enumerate(zip(NAMES, LIMITS, strict=True)):
        numbers = _numbers(content[name], where, name, limits)
        if len(numbers) != NUM_POINTS:
            raise _wrong(where, name, f"{NUM_POINTS} numbers", content[name])
        values[:, column] = numbers
    return CurveFile(
        name=content["name"],
        strategy=content["strategy"],
        start=content["start"],
        durations=tuple(durations),
        values=values,
        pose=_pose(content["pose"], where) if "pose" in content else None,
        ground=_ground(content, where) if {"region", "place"} & set(content) else None,
    )


def dump(curve: CurveFile) -> str:
    """The text of the style's file; `parse_text` gives the same numbers back."""
    lines = []
    for key, value in curve.plain().items():
        text = yaml.safe_dump(value, default_flow_style=True, width=10_000)
        line = f"{key}: {text.strip().removesuffix('...').strip()}"
        lines.append(f"{line}  # {_COMMENTS[key]}" if key in _COMMENTS else line)
    return "\n".join(lines) + "\n"


def check_start(curve: CurveFile, references: Sequence[str]) -> None:
    """Raise MotionError if the style starts from none of the reference motions."""
    if curve.pose is None and curve.start.removeprefix(MIRRORED) not in references:
        raise _unknown_start(curve.name, curve.start, references)


def _pose(content: Any, where: str) -> np.ndarray:
    pose = np.array(_numbers(content, where, "pose", (-1e3, 1e3)))
    if len(pose) < 8 or not 0.9 < float(np.linalg.norm(pose[3:7])) < 1.1:
        raise _wrong(where, "pose", "a root position, a unit quaternion and hinge angles", content)
    return pose


def _ground(content: Mapping, where: str) -> tuple[str, int]:
    region, place = content.get("region"), content.get("place")
    if region not in REGIONS:
        raise _wrong(where, "region", f"one of {', '.join(REGIONS)}", region)
    if isinstance(place, bool) or not isinstance(place, int) or not 1 <= place <= MOST_PLACES:
        raise _wrong(where, "place", f"a whole number from 1 to {MOST_PLACES}", place)
    return str(region), place


def _numbers(content: Any, where: str, key: str, limits: tuple[float, float]) -> list[float]:
    low, high = limits
    expected = f"numbers from {low:g} to {high:g}"
    if not isinstance(content, list) or len(content) > 1000:
        raise _wrong(where, key, expected, content)
    numbers: list[float] = []
    for value in content:
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not number or not low <= value <= high:  # which NaN is not, and integers of any size
            raise _wrong(where, key, expected, value)
        numbers.append(float(value))
    return numbers


def _wrong(where: str, key: str, expected: str, got: Any) -> MotionError:
    return MotionError(f"{where}: {key}: expected {expected}, got {_shown(got)}")


def _shown(value: Any) -> str:
    """A value in a few characters; Python writes no integer of thousands of digits."""
    try:
        return _SHORT.repr(value)
    except ValueError:
        return "a number of thousands of digits"


def _unknown_start(name: str, start: str, known: Sequence[str]) -> MotionError:
    return MotionError(
        f"{name}: start: expected one of {', '.join(known) or 'no motion'}, got {start!r}; "
        "name one of them, or add the motion to motion.source"
    )
