"""Found paths: states between lying and standing that the character has really been in.

`getup-search` finds them by sampling. Unlike the frames of a reference motion they obey physics, so
that an episode that starts from one of them can be finished.
"""

from __future__ import annotations

import dataclasses
import zipfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from getup_jax.config import ConfigError
from getup_jax.core.resources import asset_path
from getup_jax.motion.clips import GetUp

SHIPPED = "authored"  # names the folder of the package, of the authored motions and their prior
_FIELDS = ("qpos", "qvel", "action", "time", "task_reward", "finished", "seed")


@dataclasses.dataclass(frozen=True)
class FoundPath:
    """N states of one style, sorted by time."""

    qpos: np.ndarray  # [N, 7 + J]
    qvel: np.ndarray  # [N, 6 + J]
    action: np.ndarray  # [N, A] filtered action, which the body is moving towards
    time: np.ndarray  # [N] s since the curve's start
    task_reward: np.ndarray  # [N] of the half of the population that follows the curve best
    finished: bool  # the path ends standing
    seed: int

    def near(self, time: float, within: float) -> np.ndarray:
        """Numbers of the states at most `within` seconds away from a time."""
        return np.arange(
            np.searchsorted(self.time, time - within),
            np.searchsorted(self.time, time + within, side="right"),
        )


def path_file(folder: Path, getup: GetUp, seed: int) -> Path:
    """Where the path of a search is: folder/STYLE.SEED.npz."""
    return folder / f"{getup.name}.{seed}.npz"


def save_path(folder: Path, getup: GetUp, path: FoundPath) -> Path:
    """Write one path to its file, all of it or nothing."""
    folder.mkdir(parents=True, exist_ok=True)
    file = path_file(folder, getup, path.seed)
    partial = file.with_suffix(".part")
    with partial.open("wb") as stream:
        np.savez_compressed(stream, **{name: getattr(path, name) for name in _FIELDS})
    partial.replace(file)
    return file


def load_path(file: Path) -> FoundPath:
    """Read what `save_path` wrote; ConfigError if it is damaged or something else."""
    try:
        with np.load(file) as data:
            values = {name: data[name] for name in _FIELDS}
    except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise ConfigError(
            f"{file}: not a path that getup-search wrote ({error}); delete it and search again"
        ) from error
    return FoundPath(
        **{name: values[name] for name in _FIELDS[:5]},
        finished=bool(values["finished"]),
        seed=int(values["seed"]),
    )


def check(folder: str | None) -> None:
    """Raise ConfigError where the folder of archived states is not there; None: there are none."""
    if folder is not None:
        _place(folder)


def _place(folder: str) -> Path:
    place = asset_path("paths") if folder == SHIPPED else Path(folder)
    if not place.is_dir():
        raise ConfigError(
            f"curriculum.archive: no folder {folder}; make it with "
            f"`getup-search CONFIG --out {folder}`"
        )
    return place


def load_paths(
    folder: str, getups: Sequence[GetUp], num_joints: int, action_size: int
) -> list[FoundPath | None]:
    """The states of every style, of all its files in one; None for a style that has none.

    folder: of getup-search, or `authored` for those that are shipped. Without a pose prior
    (action_size = num_joints) a state's action is unknown, NaN, and only the state is taken.
    """
    place = _place(folder)
    found = []
    for getup in getups:
        files = sorted(place.glob(f"{getup.name}.[0-9]*.npz"))
        paths = [load_path(file) for file in files]
        if action_size == num_joints:
            paths = [_without_action(path, action_size) for path in paths]
        for file, path in zip(files, paths, strict=True):
            shape = path.qpos.shape[1], path.action.shape[1]
            if shape != (7 + num_joints, action_size):
                raise ConfigError(
                    f"{file}: expected {7 + num_joints} positions and {action_size} actions, got "
                    f"{shape[0]} and {shape[1]}; it was found for another character or prior; set "
                    "curriculum.archive=null, or search anew with getup-search"
                )
        found.append(_joined(paths) if paths else None)
    return found


def _without_action(path: FoundPath, action_size: int) -> FoundPath:
    return dataclasses.replace(path, action=np.full((len(path.time), action_size), np.nan))


def _joined(paths: Sequence[FoundPath]) -> FoundPath:
    order = np.argsort(np.concatenate([path.time for path in paths]), kind="stable")
    values = {
        name: np.concatenate([getattr(path, name) for path in paths])[order] for name in _FIELDS[:5]
    }
    return FoundPath(**values, finished=any(p.finished for p in paths), seed=paths[0].seed)
