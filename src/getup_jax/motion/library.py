"""All motions that a config names: get-ups to train on and poses for the pose prior."""

from __future__ import annotations

import dataclasses
import importlib.util
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from getup_jax.config import MotionConfig
from getup_jax.core.cpus import cpus
from getup_jax.motion.authoring.library import carried_files
from getup_jax.motion.clips import Clip, GetUp, MotionError
from getup_jax.motion.getup.getups import cut_getup, find_getups
from getup_jax.motion.io import curve_file
from getup_jax.motion.io.readers import ReadOptions, is_clip, motion_files
from getup_jax.motion.retarget.cache import Job, read_npz, retarget_files
from getup_jax.motion.retarget.retarget import RetargetReport, RetargetSettings
from getup_jax.physics.character import CharacterSpec

AUTHORED, DEEPMIMIC = "authored", "deepmimic"
_SEED = 0  # of the noise on authored poses


@dataclasses.dataclass(frozen=True, eq=False)
class MotionLibrary:
    """What the motion part hands to training."""

    getups: tuple[GetUp, ...]
    poses: np.ndarray  # [N, 7 + J], mirror images included
    report: dict[str, RetargetReport]  # file -> how well it was retargeted

    def getup(self, name: str) -> GetUp:
        """The get-up of that name; an unknown name lists the right ones."""
        return _named(self.getups, name)


def load_motions(
    config: MotionConfig,
    character: CharacterSpec,
    done: Callable[[Path], None] = lambda path: None,
) -> MotionLibrary:
    """Read, retarget (or take from the cache) and cut everything in `motion.source`.

    `done` is called after each file of `to_retarget`. Raises MotionError where a source or a curve
    is missing.
    """
    authored = AUTHORED in config.source
    getups, poses = _authored(config, character, done) if authored else ([], [])
    drawn = _drawn_files(config)
    files = _motion_files(config)
    clips, report = _clips(files, character, done)
    getups += _getups_of(clips, config.curves, character)
    getups += _drawn(drawn, getups, character)
    _require_unique(getups)
    chosen = _choose(getups, config.curves)
    poses += [clip.qpos for clip in clips]
    if not poses:
        raise MotionError(f"motion.source: {list(config.source)} holds no motion")
    stacked = np.concatenate(poses)
    if config.mirror:
        stacked = np.concatenate([stacked, character.mirror(stacked)])
    return MotionLibrary(tuple(chosen), stacked, report)


def to_retarget(config: MotionConfig, character: CharacterSpec) -> list[Path]:
    """The files of `motion.source` that are not of this character; kept ones are retargeted once.

    Raises MotionError where a source is missing.
    """
    others = [file for file in _motion_files(config) if not is_clip(file)]
    return [*(carried_files(character) if AUTHORED in config.source else ()), *others]


def _drawn_files(config: MotionConfig) -> list[str]:
    return [source for source in config.source if Path(source).suffix in curve_file.SUFFIXES]


def _motion_files(config: MotionConfig) -> list[Path]:
    others = {AUTHORED, *_drawn_files(config)}
    return [file for source in config.source if source not in others for file in _files(source)]


def _drawn(files: Sequence[str], getups: Sequence[GetUp], character: CharacterSpec) -> list[GetUp]:
    """The styles in curve files: curves alone, but for those with a start pose of their own."""
    known = tuple(getup.name for getup in getups if getup.clip is not None)
    found: list[GetUp] = []
    for file in files:
        curve = curve_file.read_curve_file(Path(file).expanduser())
        curve_file.check_start(curve, known)
        own_pose = None if curve.pose is None else curve.start_clip({}, character)
        found += curve.getups(own_pose)
    return found


def deepmimic_folder() -> Path:
    """The motions that the `pybullet` wheel carries (DeepMimic's, MIT licence)."""
    spec = importlib.util.find_spec("pybullet_data")
    if spec is None or spec.origin is None:
        raise MotionError(
            "motion.source: deepmimic: expected the motions that come with pybullet, found none; "
            "pip install 'getup-jax[deepmimic]' (or pybullet), or name the folder that holds "
            "humanoid3d_getup_*.txt"
        )
    return Path(spec.origin).parent / "data" / "motions"


def _files(source: str) -> list[Path]:
    if source == DEEPMIMIC:  # its folder holds a quadruped's motions too
        return sorted(deepmimic_folder().glob("humanoid3d_*.txt"))
    path = Path(source).expanduser()
    if path.is_dir():
        files = motion_files(path)
        if not files:
            raise MotionError(f"motion.source: {path}: no motion files in this folder")
        return files
    if not path.is_file():
        raise MotionError(
            f"motion.source: {source!r}: expected '{AUTHORED}', '{DEEPMIMIC}', a folder or a "
            "file, and there is none of that name"
        )
    return [path]


def _clips(
    files: Sequence[Path], character: CharacterSpec, done: Callable[[Path], None]
) -> tuple[list[Clip], dict[str, RetargetReport]]:
    """Every file's clip; short files are taken, as their warning says."""
    read = ReadOptions(allow_short=True)
    jobs = [Job(file, character, read, RetargetSettings()) for file in files if not is_clip(file)]
    results = retarget_files(jobs, cpus(), lambda path, _: done(path))
    fresh = dict(zip([job.path for job in jobs], results, strict=True))
    clips, report = [], {}
    for file in files:
        result = fresh[file] if file in fresh else read_npz(file, character)
        if isinstance(result, MotionError):
            raise result
        clips.append(result[0])
        report[str(file)] = result[1]
    return clips, report


def _authored(
    config: MotionConfig, character: CharacterSpec, done: Callable[[Path], None]
) -> tuple[list[GetUp], list[np.ndarray]]:
    from getup_jax.motion.authoring.keyframes import authored_poses, load_authored

    getups = load_authored(character, done)
    noise, count = config.augment_noise_rad, config.augment_poses
    return getups, [authored_poses(getups, character, count, noise, _SEED)]


def _getups_of(
    clips: Sequence[Clip], wanted: Sequence[str], character: CharacterSpec
) -> list[GetUp]:
    """Explicit cuts `clip:start-stand` of each clip, and what is found in the others."""
    getups = []
    for clip in clips:
        cuts = [cut for cut in map(_cut, wanted) if cut and cut[0] == clip.name]
        getups += [cut_getup(clip, character, start, stand) for _, start, stand in cuts]
        if not cuts:
            getups += find_getups(clip, character)[1]
    return getups


def _cut(name: str) -> tuple[str, int, int] | None:
    """(clip, start, stand) of `clip:start-stand`, else None."""
    clip, colon, frames = name.rpartition(":")
    first, dash, last = frames.partition("-")
    if colon and dash and first.isdecimal() and last.isdecimal():
        return clip, int(first), int(last)
    return None


def _choose(getups: Sequence[GetUp], wanted: Sequence[str]) -> list[GetUp]:
    """The get-ups named in `motion.curves` in that order; a clip's name takes all of its."""
    if not wanted:
        return list(getups)
    chosen: list[GetUp] = []
    for name in wanted:
        of_clip = [g for g in getups if _cut(g.name) and g.name.rpartition(":")[0] == name]
        chosen += of_clip or [_named(getups, name)]
    return chosen


def _require_unique(getups: Sequence[GetUp]) -> None:
    names = [getup.name for getup in getups]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise MotionError(
            f"motion.source: two get-ups are called {', '.join(twice)}; rename one of the files"
        )


def _named(getups: Sequence[GetUp], name: str) -> GetUp:
    for getup in getups:
        if getup.name == name:
            return getup
    known = ", ".join(getup.name for getup in getups) or "none"
    raise MotionError(f"motion.curves: no get-up {name!r}; found: {known}")
