"""Acclaim motions: a skeleton (.asf) and the angles (.amc) that the CMU database comes in.

A bone turns at its start by C M C^-1, where C is its own axes at rest and M its angles about
them; its direction and C are given in world axes (Y up). Only degrees and the angle order
XYZ are read, which is what the database uses.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from getup_jax.motion.bvh import Y_UP
from getup_jax.motion.clips import MotionError
from getup_jax.motion.skeleton import Recording, turned

CMU_FPS = 120.0  # the files do not say their rate


@dataclasses.dataclass
class Bone:
    """One bone of the skeleton, in file units."""

    name: str
    direction: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(3))
    length: float = 0.0
    axes: Rotation = dataclasses.field(default_factory=Rotation.identity)
    dof: tuple[str, ...] = ()
    parent: int = -1


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
    beside = sorted(path.parent.glob("*.asf"))
    if named.is_file() or len(beside) == 1:
        return named if named.is_file() else beside[0]
    raise MotionError(
        f"{path.name}: expected its skeleton {named.name} in the same folder, found "
        f"{[file.name for file in beside]}; copy it there"
    )


def read_asf(path: Path) -> list[Bone]:
    """The bones, the root first, parents before children."""
    bones, section, bone = [Bone("root", dof=("tx", "ty", "tz", "rx", "ry", "rz"))], "", None
    for number, line in enumerate(path.read_text(errors="replace").splitlines(), 1):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        if words[0].startswith(":"):
            section = words[0]
        elif section == ":bonedata":
            bone = _bone_line(bones, bone, words, f"{path.name}, line {number}")
        elif section == ":hierarchy" and words[0] not in ("begin", "end"):
            _link(bones, words, f"{path.name}, line {number}")
        elif section == ":root" and words[:1] == ["order"]:
            bones[0].dof = tuple(word.lower() for word in words[1:])
    loose = [bone.name for bone in bones[1:] if bone.parent < 0]
    if len(bones) == 1 or loose:
        raise MotionError(f"{path.name}: expected bones with a hierarchy; without parent: {loose}")
    return _parents_first(bones)


def _bone_line(bones: list[Bone], bone: Bone | None, words: list[str], where: str) -> Bone | None:
    """One line of :bonedata; the bone that it belongs to."""
    key, values = words[0], words[1:]
    if key == "begin":
        bone = Bone("")
        bones.append(bone)
    elif bone is not None and key == "name":
        bone.name = values[0]
    elif bone is not None and key == "dof":
        bone.dof = tuple(value.lower() for value in values)
    elif bone is not None and key in ("direction", "length", "axis"):
        try:
            numbers = np.array(values[:3] if key != "length" else values[:1], np.float64)
        except ValueError:
            raise MotionError(f"{where}: {key}: expected numbers, got {values}") from None
        if key == "direction":
            bone.direction = numbers / max(float(np.linalg.norm(numbers)), 1e-9)
        elif key == "length":
            bone.length = float(numbers[0])
        else:
            bone.axes = Rotation.from_euler("xyz", numbers, degrees=True)
    return bone


def _link(bones: list[Bone], words: list[str], where: str) -> None:
    names = [bone.name for bone in bones]
    unknown = [word for word in words if word not in names]
    if unknown:
        raise MotionError(f"{where}: unknown bones {unknown}; known are {', '.join(names)}")
    for word in words[1:]:
        bones[names.index(word)].parent = names.index(words[0])


def _parents_first(bones: list[Bone]) -> list[Bone]:
    order = [0]
    for index in order:
        order += [i for i, bone in enumerate(bones) if bone.parent == index and i > 0]
    place = {old: new for new, old in enumerate(order)}
    return [dataclasses.replace(bones[i], parent=place.get(bones[i].parent, -1)) for i in order]


def _frames(path: Path, bones: list[Bone]) -> list[dict[str, list[float]]]:
    """One {bone: values} a frame; MotionError names the line and the bone."""
    width = {bone.name: len(bone.dof) for bone in bones}
    still = {bone.name: [] for bone in bones if not bone.dof}
    frames: list[dict[str, list[float]]] = []
    for number, line in enumerate(path.read_text(errors="replace").splitlines(), 1):
        words = line.split()
        if not words or words[0][0] in "#:":
            continue
        if len(words) == 1 and words[0].isdecimal():
            frames.append(dict(still))
            continue
        where = f"{path.name}, line {number}"
        values = _values(where, words)
        if words[0] not in width or len(values) != width[words[0]] or not frames:
            expected = width.get(words[0], "a bone of the skeleton and its")
            raise MotionError(f"{where}, bone {words[0]}: expected {expected} angles, got {values}")
        frames[-1][words[0]] = values
    for number, frame in enumerate(frames):
        missing = [name for name in width if name not in frame]
        if missing:
            raise MotionError(f"{path.name}, frame {number + 1}: no values for bones {missing}")
    if not frames:
        raise MotionError(f"{path.name}: expected frames, got none")
    return frames


def _values(where: str, words: list[str]) -> list[float]:
    try:
        values = [float(word) for word in words[1:]]
    except ValueError:
        values = [np.nan]
    if not np.isfinite(values).all():
        raise MotionError(f"{where}, bone {words[0]}: expected finite numbers, got {words[1:]}")
    return values
