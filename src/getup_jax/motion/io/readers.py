"""Any motion file into a Recording: the format is told by suffix and content."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from getup_jax.motion.clips import MotionError
from getup_jax.motion.io import asf_amc, bvh, composite_json, deepmimic, smpl
from getup_jax.motion.io.guard import one_line
from getup_jax.motion.io.recording import Recording
from getup_jax.motion.io.text import decode, read_json

SUFFIXES = (".bvh", ".txt", ".json", ".amc")
NPZ = ".npz"  # a clip of this package, or a motion of SMPL


@dataclasses.dataclass(frozen=True)
class ReadOptions:
    """What files do not say about themselves."""

    up: str = "auto"  # y | z: the vertical axis of BVH and SMPL files; auto: as they show
    allow_short: bool = False  # take BVH files that lack more than one row, or have too many
    fps: float | None = (
        None  # rate of BVH, AMC and SMPL files, in place of what they say or leave out
    )


def read_motion(path: str | Path, options: ReadOptions = ReadOptions()) -> Recording:
    """The recording in a file, Z up, lengths in the file's own unit.

    Whatever is wrong with the file is a MotionError.
    """
    path = Path(path)
    if not path.is_file():
        raise MotionError(f"{path}: no such file")
    with one_line(path.name):
        return _read(path, options)


def _read(path: Path, options: ReadOptions) -> Recording:
    suffix = path.suffix.lower()
    if suffix == ".bvh":
        how = bvh.BvhOptions(up=options.up, allow_short=options.allow_short, fps=options.fps)
        return bvh.read_bvh(path, how)
    if suffix == ".amc":
        return asf_amc.read_amc(path, options.fps or asf_amc.CMU_FPS)
    if suffix in (".txt", ".json"):
        return _read_json(path)
    if suffix == NPZ:
        return smpl.read_smpl(path, options.up, options.fps)
    raise MotionError(f"{path.name}: unknown format {suffix!r}; known are {', '.join(SUFFIXES)}")


def is_clip(path: Path) -> bool:
    """Whether a file is a clip that is on the character already, and is not read but loaded."""
    return path.suffix.lower() == NPZ and not smpl.is_smpl(path)


def motion_files(folder: Path) -> list[Path]:
    """The motion files below a folder, sorted; those that only look alike are left out."""
    found = [file for file in folder.rglob("*") if file.suffix.lower() in (*SUFFIXES, NPZ)]
    return sorted(file for file in found if file.is_file() and not _is_other_text(file))


def _read_json(path: Path) -> Recording:
    content = read_json(path)
    if isinstance(content, dict) and "Frames" in content:
        return deepmimic.decode(path, content)
    if isinstance(content, dict) and "frames" in content:
        return composite_json.decode(path, content)
    raise MotionError(
        f"{path.name}: expected DeepMimic's {{Loop, Frames}} or {{fps, frames}}, got neither"
    )


def _is_other_text(file: Path) -> bool:
    """A .txt or .json without the word `frames` near its start is no motion."""
    if file.suffix.lower() not in (".txt", ".json"):
        return False
    try:
        with file.open("rb") as stream:
            return "frames" not in decode(stream.read(4096)).lower()
    except OSError:
        return False  # its reader says why
