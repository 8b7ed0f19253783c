"""Acclaim motions: a skeleton (.asf) and the angles (.amc) that the CMU database comes in.

A bone turns at its start by C M C^-1, where C is its own axes at rest and M its angles about
them; its direction and C are given in world axes (Y up). Only the angle order XYZ is read, which
is what the database uses.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from getup_jax.motion.clips import MotionError
from getup_jax.motion.io.bvh import Y_UP
from getup_jax.motion.io.bvh_header import without_comment
from getup_jax.motion.io.recording import Recording, turned
from getup_jax.motion.io.text import number, read_lines, said

CMU_FPS = 120.0  # the files do not say their rate
_MOST_BONES = 500
_DOF = ("tx", "ty", "tz", "rx", "ry", "rz")


@dataclasses.dataclass
class Bone:
    """One bone of the skeleton, in file units."""

    name: str
    direction: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(3))
    length: float = 0.0
    axes: Rotation = dataclasses.field(default_factory=Rotation.identity)
    dof: tuple[str, ...] = ()
    parent: int = -1


@dataclasses.dataclass(frozen=True)
class Line:
    """One line of a file with words in it."""

    file: str
    number: int  # 1-based
    words: tuple[str, ...]

    @property
    def where(self) -> str:
        """File and line."""
        return f"{self.file}, line {self.number}"

    def numbers(self, key: str, count: int) -> list[float]:
        """The first `count` of the words behind the key as finite numbers."""
        values = [number(word) for word in self.words[1 : 1 + count]]
        found = [value for value in values if value is not None]
        if len(found) != count:
            got = said(" ".join(self.words[1:]))
            raise MotionError(f"{self.where}: {key}: expected {count} finite numbers, got {got}")
        return found


def read_amc(path: str | Path, fps: float = CMU_FPS) -> Recording:
    """The motion of an .amc file; its skeleton is the .asf beside it."""
    path = Path(path)
    bones = read_asf(find_asf(path))
    frames = _frames(path, bones)
    count, ends = len(bones), [bone.direction * bone.length for bone in bones]
    offsets = np.array([ends[bone.parent] if bone.parent >= 0 else np.zeros(3) for bone in bones])
    translations = np.tile(offsets, (len(frames), 1, 1))
    rotations = np.empty((len(frames), count, 4))
    for index, bone in enumerate(bones):
        angles = np.zeros((len(frames), 3))
        values = np.array([frame[bone.name] for frame in frames]).reshape(len(frames), -1)
        for column, dof in enumerate(bone.dof):
            if dof[0] == "t":
                translations[:, index, "xyz".index(dof[1])] = values[:, column]
            else:
                angles[:, "xyz".index(dof[1])] = values[:, column]
        turn = Rotation.from_euler("xyz", angles, degrees=True)
        rotations[:, index] = (bone.axes * turn * bone.axes.inv()).as_quat(scalar_first=True)
    raw = Recording(
        name=path.stem,
        fps=fps,
        joint_names=tuple(bone.name for bone in bones),
        parents=tuple(bone.parent for bone in bones),
        offsets=offsets,
        translations=translations,
        rotations=rotations,
        ends={i: ends[i] for i in range(1, count) if all(b.parent != i for b in bones)},
        source=str(path),
    )
    return turned(raw, Y_UP)


def find_asf(path: Path) -> Path:
    """`01.asf` for `01_05.amc`, else the only .asf in the folder."""
    named = path.with_name(path.stem.partition("_")[0] + ".asf")
    beside = [file for file in sorted(path.parent.iterdir()) if file.suffix.lower() == ".asf"]
    same = [file for file in beside if file.stem.lower() == named.stem.lower()]
    if same or len(beside) == 1:
        return (same or beside)[0]
    raise MotionError(
        f"{path.name}: expected its skeleton {named.name} in the same folder, found "
        f"{[file.name for file in beside]}; copy it there"
    )


def read_asf(path: Path) -> list[Bone]:
    """The bones, the root first, parents before children."""
    bones, section, bone = [Bone("root", dof=_DOF)], "", None
    for line in _lines(path):
        key = line.words[0].lower()
        if key.startswith(":"):
            section = key
        elif section == ":bonedata":
            bone = _bone_line(bones, bone, line)
        elif section == ":hierarchy" and key not in ("begin", "end"):
            _link(bones, line)
        elif section == ":root" and key == "order":
            bones[0].dof = _dof(line)
        elif section == ":root" and key == "axis":
            _require_xyz(line, line.words[1:])
        elif section == ":units" and key == "angle" and line.words[-1].lower() != "deg":
            raise MotionError(f"{line.where}: angle: expected deg, got {said(line.words[-1])}")
    loose = [bone.name for bone in bones[1:] if bone.parent < 0]
    ordered = _parents_first(bones)
    if len(bones) == 1 or loose or len(ordered) < len(bones):
        lost = loose or [bone.name for bone in bones if bone not in ordered]
        raise MotionError(f"{path.name}: expected bones with a hierarchy; without parent: {lost}")
    return ordered


def _lines(path: Path) -> Iterator[Line]:
    """Every line with words in it."""
    for at, line in enumerate(read_lines(path), 1):
        words = without_comment(line).split()
        if words:
            yield Line(path.name, at, tuple(words))


def _bone_line(bones: list[Bone], bone: Bone | None, line: Line) -> Bone | None:
    """One line of :bonedata; the bone that it belongs to."""
    key = line.words[0].lower()
    if key == "begin":
        if len(bones) > _MOST_BONES:
            raise MotionError(f"{line.where}: expected at most {_MOST_BONES} bones, got more")
        bones.append(Bone(f"bone {len(bones)}"))
        return bones[-1]
    if bone is None:
        return None
    if key == "name":
        bone.name = " ".join(line.words[1:]) or bone.name
        if any(other.name == bone.name for other in bones if other is not bone):
            raise MotionError(f"{line.where}: bone {bone.name} appears twice; rename one")
    elif key == "dof":
        bone.dof = _dof(line)
    elif key == "direction":
        direction = np.array(line.numbers(key, 3))
        bone.direction = direction / max(float(np.linalg.norm(direction)), 1e-9)
    elif key == "length":
        (bone.length,) = line.numbers(key, 1)
    elif key == "axis":
        bone.axes = Rotation.from_euler("xyz", line.numbers(key, 3), degrees=True)
        _require_xyz(line, line.words[4:])
    return bone


def _dof(line: Line) -> tuple[str, ...]:
    dof = tuple(word.lower() for word in line.words[1:])
    if not set(dof) <= set(_DOF) or len(set(dof)) < len(dof):
        raise MotionError(
            f"{line.where}: {line.words[0]}: expected some of {', '.join(_DOF)}, each once, got "
            f"{said(' '.join(line.words[1:]))}"
        )
    return dof


def _require_xyz(line: Line, order: Sequence[str]) -> None:
    if order and order[0].lower() != "xyz":
        raise MotionError(
            f"{line.where}: axis: expected the order XYZ, got {said(order[0])}; export it in XYZ"
        )


def _link(bones: list[Bone], line: Line) -> None:
    names = [bone.name for bone in bones]
    unknown = [word for word in line.words if word not in names]
    if unknown:
        known = ", ".join(names)
        raise MotionError(f"{line.where}: unknown bones {unknown[:5]}; known are {known}")
    for word in line.words[1:]:
        bones[names.index(word)].parent = names.index(line.words[0])


def _parents_first(bones: list[Bone]) -> list[Bone]:
    """The bones that hang on the root."""
    order = [0]
    for index in order:
        order += [i for i, bone in enumerate(bones) if bone.parent == index and i not in order]
    place = {old: new for new, old in enumerate(order)}
    bones[0].parent = -1
    for index in order[1:]:
        bones[index].parent = place[bones[index].parent]
    return [bones[index] for index in order]


def _frames(path: Path, bones: list[Bone]) -> list[dict[str, list[float]]]:
    """One {bone: values} a frame; MotionError names the line and the bone."""
    width = {bone.name: len(bone.dof) for bone in bones}
    still: dict[str, list[float]] = {bone.name: [] for bone in bones if not bone.dof}
    frames: list[dict[str, list[float]]] = []
    for line in _lines(path):
        name = line.words[0]
        if name.lower() == ":radians":
            raise MotionError(f"{line.where}: expected :DEGREES, got {name}; export degrees")
        if name.startswith(":"):
            continue
        if len(line.words) == 1 and name.isdecimal():
            frames.append(dict(still))
            continue
        values = _values(line)
        if len(values) != width.get(name, -1) or not frames or name in frames[-1]:
            expected = width.get(name, "a bone of the skeleton and its")
            raise MotionError(
                f"{line.where}, bone {name}: expected {expected} angles, once a frame, got {values}"
            )
        frames[-1][name] = values
    for at, frame in enumerate(frames):
        if len(frame) < len(width):
            missing = [name for name in width if name not in frame]
            raise MotionError(f"{path.name}, frame {at + 1}: no values for bones {missing}")
    if not frames:
        raise MotionError(f"{path.name}: expected frames, got none")
    return frames


def _values(line: Line) -> list[float]:
    values = [number(word) for word in line.words[1:]]
    found = [value for value in values if value is not None]
    if len(found) < len(values):
        got = list(line.words[1:10])
        raise MotionError(f"{line.where}, bone {line.words[0]}: expected finite numbers, got {got}")
    return found
