"""Keyframe files: a motion as a short list of poses that a person can read and edit.

    name: supine_quadruped_left
    strategy: quadruped push-up
    keyframes:
      - time: 0.0                          # s, the first is 0
        note: lying on the back
        position: [0.0, 0.0, 0.1]          # m, pelvis
        rotation: [0.0, -90.0, 0.0]        # degrees, rotation vector of the pelvis
        planted: [foot_r]                  # contacts that stay put until the next keyframe
        angles: {arm_l: [0, 28, 10], shin_l: -4}   # degrees: flexion, abduction, twist

A link that a keyframe does not name keeps the angles of the keyframe before; the first one
starts from the neutral pose, and `pose: neutral` puts every link back to it.

`mirror_of: supine_quadruped_left` in place of the keyframes takes the mirror image of another
file of the folder. `duration: 3.6` (s) stretches the times of either kind.

`loop: true` closes the motion: its last keyframe takes the first one's pose at its own place and
names neither rotation nor angles. `airborne: true` in a keyframe: from it to the next one the
body flies freely and nothing touches the floor.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from scipy.spatial.transform import Rotation

from getup_jax.config.check import did_you_mean
from getup_jax.motion.authoring.contact_ik import CONTACT_NAMES
from getup_jax.motion.clips import MotionError
from getup_jax.physics.character import CharacterSpec

_TOP_KEYS = ("name", "strategy", "description", "duration", "mirror_of", "loop", "keyframes")
_FRAME_KEYS = ("time", "note", "position", "rotation", "planted", "airborne", "pose", "angles")
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # the C one is ten times as fast
_AXES = ("flex", "abd", "twist")
_ROUNDING_RAD = 1e-3  # a file holds tenths of a degree, so a limit may be missed by this much


@dataclasses.dataclass(frozen=True, eq=False)
class Keyframe:
    """One authored pose."""

    time: float  # s
    qpos: np.ndarray  # [7 + J]
    planted: tuple[str, ...]  # contact_ik.CONTACT_NAMES that stay put until the next one
    note: str = ""
    airborne: bool = False  # flies freely until the next one


@dataclasses.dataclass(frozen=True, eq=False)
class KeyframeMotion:
    """A motion as authored: its poses in order of time."""

    name: str
    strategy: str
    keyframes: tuple[Keyframe, ...]
    description: str = ""
    loop: bool = False  # the last pose is the first one, moved along

    @property
    def duration(self) -> float:
        """Seconds to the last keyframe."""
        return self.keyframes[-1].time


def read_keyframes(path: str | Path, character: CharacterSpec) -> KeyframeMotion:
    """Read and check one keyframe file.

    Raises MotionError naming the file, the keyframe and the key or joint that is wrong.
    """
    path = Path(path)
    try:
        content = yaml.load(path.read_text(encoding="utf-8"), _LOADER)
    except yaml.YAMLError as error:
        raise MotionError(f"{path.name}: not valid YAML: {error}") from error
    except OSError as error:
        raise MotionError(f"{path}: cannot be read: {error.strerror}") from error
    _check_keys(content, _TOP_KEYS, path.name)
    name = content.get("name", path.stem)
    if name != path.stem:
        raise MotionError(f"{path.name}: name: expected {path.stem!r}, as the file, got {name!r}")
    frames = _mirrored(content, path, character) or _listed(content, path, character)
    if "duration" in content:
        duration = float(_numbers(content["duration"], 1, f"{path.name}: duration", "s")[0])
        frames = _stretched(frames, duration / frames[-1].time)
    loop = content.get("loop", False)
    if loop is not False:
        frames[-1] = _closing(frames, content, path.name)
    strategy, text = content.get("strategy", ""), content.get("description", "")
    return KeyframeMotion(path.stem, str(strategy), tuple(frames), str(text).strip(), bool(loop))


def _closing(frames: Sequence[Keyframe], content: Mapping, name: str) -> Keyframe:
    """The last keyframe of a loop: the first one's pose at the last one's place."""
    last = (content.get("keyframes") or [{}])[-1]
    named = [key for key in ("rotation", "angles", "pose", "airborne") if key in last]
    if content["loop"] is not True or named:
        raise MotionError(
            f"{name}: loop: expected true, and a last keyframe with time and position alone, since "
            f"its pose is the first one's; got {content['loop']!r} and {', '.join(named) or 'none'}"
        )
    first, end = frames[0].qpos, frames[-1].qpos
    qpos = np.concatenate([end[:2], first[2:]])
    return dataclasses.replace(frames[-1], qpos=qpos)


def _listed(content: Mapping, path: Path, character: CharacterSpec) -> list[Keyframe]:
    frames = content.get("keyframes")
    if not isinstance(frames, list) or len(frames) < 2:
        raise MotionError(
            f"{path.name}: keyframes: expected a list of at least 2, or mirror_of, got {frames!r}"
        )
    parsed: list[Keyframe] = []
    for number, frame in enumerate(frames):
        place = f"{path.name}: keyframe {number}"
        parsed.append(_parse_frame(frame, parsed[-1] if parsed else None, character, place))
    return parsed


def _mirrored(content: Mapping, path: Path, character: CharacterSpec) -> list[Keyframe]:
    """The mirror images of the keyframes of another file; empty where none is named."""
    if "mirror_of" not in content:
        return []
    original = path.with_name(f"{content['mirror_of']}.yaml")
    if "keyframes" in content or not original.is_file() or original == path:
        raise MotionError(
            f"{path.name}: mirror_of: expected the name of another file in {path.parent} and no "
            f"keyframes beside it, got {content['mirror_of']!r}"
        )
    other = {"l": "r", "r": "l"}
    return [
        dataclasses.replace(
            key,
            qpos=character.mirror(key.qpos),
            planted=tuple(name[:-1] + other[name[-1]] for name in key.planted),
        )
        for key in read_keyframes(original, character).keyframes
    ]


def _stretched(frames: Sequence[Keyframe], factor: float) -> list[Keyframe]:
    return [dataclasses.replace(key, time=key.time * factor) for key in frames]


def _parse_frame(
    frame: Any, before: Keyframe | None, character: CharacterSpec, place: str
) -> Keyframe:
    _check_keys(frame, _FRAME_KEYS, place)
    time = float(_numbers(frame.get("time"), 1, f"{place}: time", "s")[0])
    place = f"{place} ({time:g} s)"
    if before is None and time != 0.0:
        raise MotionError(f"{place}: time: the first keyframe is at 0, got {time:g}")
    if before is not None and time <= before.time:
        raise MotionError(f"{place}: time: expected more than the {before.time:g} s before it")
    qpos = np.array(character.neutral_qpos if before is None else before.qpos)
    pose = frame.get("pose")
    if pose not in (None, "neutral"):
        raise MotionError(f"{place}: pose: expected 'neutral' or no such key, got {pose!r}")
    if pose == "neutral":
        qpos[7:] = character.neutral_qpos[7:]
    if "position" in frame:
        qpos[:3] = _numbers(frame["position"], 3, f"{place}: position", "m")
    if "rotation" in frame:
        turn = _numbers(frame["rotation"], 3, f"{place}: rotation", "degrees")
        qpos[3:7] = np.roll(Rotation.from_rotvec(turn, degrees=True).as_quat(), 1)
    _set_angles(qpos, frame.get("angles") or {}, character, place)
    planted = tuple(frame.get("planted") or ())
    for contact in planted:
        _check_name(contact, CONTACT_NAMES, f"{place}: planted")
    airborne = frame.get("airborne", False)
    if not isinstance(airborne, bool) or (airborne and planted):
        raise MotionError(
            f"{place}: airborne: expected true or false, and nothing planted in the air, got "
            f"{airborne!r} and {list(planted)}"
        )
    return Keyframe(time, qpos, planted, str(frame.get("note", "")), airborne)


def _set_angles(qpos: np.ndarray, angles: Any, character: CharacterSpec, place: str) -> None:
    """Write the angles of a keyframe into its pose and hold them to the joint limits."""
    hinges = _hinges_by_link(character)
    if not isinstance(angles, Mapping):
        raise MotionError(f"{place}: angles: expected {{link: angle, ...}}, got {angles!r}")
    for link, values in angles.items():
        _check_name(link, tuple(hinges), f"{place}: angles")
        joints = hinges[link]
        where = f"{place}: angles: {link}"
        radians = np.radians(_numbers(values, len(joints), where, "degrees"))
        for joint, value in zip(joints, radians, strict=True):
            qpos[7 + joint] = _inside_limits(value, joint, character, where)


def _inside_limits(value: float, joint: int, character: CharacterSpec, where: str) -> float:
    lower, upper = character.joint_lower[joint], character.joint_upper[joint]
    if not lower - _ROUNDING_RAD <= value <= upper + _ROUNDING_RAD:
        raise MotionError(
            f"{where}: {character.joint_names[joint]} = {np.degrees(value):.1f} degrees: outside "
            f"its limits {np.degrees(lower):.1f} to {np.degrees(upper):.1f}"
        )
    return float(np.clip(value, lower, upper))


def _hinges_by_link(character: CharacterSpec) -> dict[str, list[int]]:
    hinges: dict[str, list[int]] = {}
    for joint, name in enumerate(character.joint_names):
        link, axis = name.rsplit("_", 1)
        if axis not in _AXES:
            raise MotionError(f"character: joint {name!r}: expected a name ending in {_AXES}")
        hinges.setdefault(link, []).append(joint)
    return hinges


def _numbers(values: Any, count: int, place: str, unit: str) -> np.ndarray:
    listed = list(values) if isinstance(values, list | tuple) else [values]
    numeric = all(isinstance(v, int | float) and not isinstance(v, bool) for v in listed)
    if len(listed) != count or not numeric or not np.all(np.isfinite(listed)):
        expected = "a number" if count == 1 else f"{count} numbers"
        raise MotionError(f"{place}: expected {expected} ({unit}), got {values!r}")
    return np.array(listed, np.float64)


def _check_keys(content: Any, known: tuple[str, ...], place: str) -> None:
    if not isinstance(content, Mapping):
        raise MotionError(f"{place}: expected keys {', '.join(known)}, got {content!r}")
    for key in content:
        _check_name(key, known, place)


def _check_name(name: Any, known: tuple[str, ...], place: str) -> None:
    if name not in known:
        hint = did_you_mean(str(name), known) or f"expected one of {', '.join(known)}"
        raise MotionError(f"{place}: unknown {name!r}; {hint}")
