"""Checkpoints: written whole or not at all, verified when read, the newest good one wins.

    FOLDER/00000120/            one checkpoint, named by its iteration
        checkpoint.json         format, iteration, steps, and the digest of every file
        config.yaml             the resolved settings
        policy/                 orbax: {"policy": ..., "prior": ..., "critic": ...}, loadable alone
        learner/                orbax: {"state": the whole TrainState}

A checkpoint is built in a hidden folder and renamed when all of it is on the disk, so that
a killed process or a full disk leaves the previous one as it was.
"""

from __future__ import annotations

import contextlib
import dataclasses
import shutil
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from getup_jax.config import Config, ConfigError
from getup_jax.config.load import dump_yaml, load_saved_config
from getup_jax.config.yaml_text import BrokenFileError
from getup_jax.core.resources import asset_path
from getup_jax.runtime import hub, integrity, processes
from getup_jax.runtime.integrity import DamagedError
from getup_jax.runtime.pytree_store import (
    CheckpointError,
    from_nested,
    read_item,
    to_nested,
    write_item,
)

CHECKPOINTS = "checkpoints"  # folder of a run that holds its checkpoints
POLICY, LEARNER = "policy", "learner"  # items of a checkpoint
MAX_EXPORT_BYTES = 5_000_000

T = TypeVar("T")


@dataclasses.dataclass(frozen=True)
class LoadedPolicy:
    """What `load_policy` found; the pytrees are nested dicts of NumPy arrays, or None."""

    policy: Any  # PolicyState by name; `from_nested` puts it into a template
    prior: Any  # the pose prior that the task was built with
    config: Config
    metadata: dict[str, Any]  # iteration, steps and the like
    path: Path  # the checkpoint's own folder
    critic: Any = None  # Valuation by name; None: it was saved without one


@dataclasses.dataclass(frozen=True)
class LoadedLearner:
    """What `load_learner` found; nested dicts of NumPy arrays."""

    learner: Any  # LearnerState by name; `from_nested` puts it into a template
    environment: Any  # the simulations and what the task keeps of them all, by name
    path: Path  # the item's own folder


@dataclasses.dataclass(frozen=True)
class Restored:
    """What `restore_learner` found."""

    state: Any  # in the structure of the template
    metadata: dict[str, Any]
    path: Path


def save_learner(
    folder: Path,
    iteration: int,
    train_state: Any,
    config: Config,
    policy: Mapping[str, Any],
    metadata: Mapping[str, Any] | None = None,
) -> Path:
    """Write FOLDER/ITERATION and keep the newest `train.keep` in all; returns its path.

    Args:
        folder: the checkpoints folder of a run.
        iteration: iterations done.
        train_state: any pytree of arrays.
        config: written as config.yaml.
        policy: the light item: {"policy": pytree, "prior": pytree or None}, and "critic" where a
            training that begins with it shall have it.
        metadata: what else checkpoint.json shall say; JSON values.

    All processes of a run call it, with one folder that they share. Raises CheckpointError where it
    could not be written; the others are then untouched.
    """
    items = {POLICY: to_nested(policy), LEARNER: to_nested({"state": train_state})}
    final = folder / f"{iteration:08d}"
    _write(final, items, config, {"iteration": iteration, **(metadata or {})})
    if processes.is_first():
        _prune(folder, iteration, config.train.keep)
    processes.barrier("saved")
    return final


def restore_learner(folder: Path, template: Any) -> Restored:
    """The newest undamaged TrainState of a checkpoints folder, in the template's structure."""
    path, nested, metadata = _newest(find_checkpoints(folder), _read_learner)
    state = from_nested({"state": template}, nested, str(path / LEARNER))["state"]
    return Restored(state, metadata, path)


def load_learner(path: str | Path) -> LoadedLearner:
    """The arrays of the newest undamaged TrainState at `path`, with no need to know its shapes.

    `path` is a run folder, its checkpoints folder or one checkpoint; an exported policy has none.
    """
    found, nested, _ = _newest(find_checkpoints(path), _read_learner)
    return LoadedLearner(
        nested["state"]["learner"], nested["state"]["environment"], found / LEARNER
    )


def load_policy(path: str | Path) -> LoadedPolicy:
    """The policy at `path`, with no need to know its shapes.

    `path` is a run folder, its checkpoints folder, one checkpoint, an exported policy, the name of
    a shipped one, or hf://OWNER/NAME on the Hugging Face Hub. Raises CheckpointError that says what
    is wrong.
    """
    return _newest(find_checkpoints(path), _read_policy)


def export_policy(source: str | Path, destination: str | Path) -> Path:
    """Copy only the policy item of a checkpoint to a folder that `load_policy` reads.

    Its config names nothing that only the training's machine has: no archived states, no other run,
    no engine.
    """
    loaded, destination = load_policy(source), Path(destination)
    if destination.exists() and not integrity.is_checkpoint(destination):
        raise CheckpointError(f"{destination}: exists and is no checkpoint; choose another folder")
    item = {"policy": loaded.policy, "prior": loaded.prior}
    items = {POLICY: item if loaded.critic is None else {**item, "critic": loaded.critic}}
    curriculum = loaded.config.curriculum
    if curriculum is not None:
        curriculum = dataclasses.replace(curriculum, archive=None)
    own = {"init_from": None, "irregular_from": None, "init_learner": False, "wandb": None}
    train = dataclasses.replace(loaded.config.train, **own)
    physics = dataclasses.replace(loaded.config.physics, engine="auto")
    config = dataclasses.replace(loaded.config, physics=physics, curriculum=curriculum, train=train)
    _write(destination, items, config, loaded.metadata, MAX_EXPORT_BYTES)
    return destination


def steps(folder: Path) -> list[Path]:
    """The checkpoints in a checkpoints folder, oldest first; unfinished ones are not."""
    if not folder.is_dir():
        return []
    return sorted((p for p in folder.iterdir() if p.name.isdigit()), key=lambda p: int(p.name))


def find_checkpoints(path: str | Path) -> list[Path]:
    """The checkpoints that `path` means, oldest first; see `load_policy` for its forms."""
    folder = hub.download(str(path)) if hub.is_address(path) else Path(path)
    if not folder.exists() and folder.parts[:-1] in ((), ("assets", CHECKPOINTS)):
        folder = asset_path(CHECKPOINTS, folder.name)
    if not folder.is_dir():
        raise CheckpointError(f"{path}: no such folder{_shipped_hint()}")
    if integrity.is_checkpoint(folder) or folder.name.isdigit():
        return [folder]
    found = steps(folder / CHECKPOINTS) or steps(folder)
    if not found:
        raise CheckpointError(
            f"{path}: holds no checkpoint; expected a run folder, a checkpoints folder, or a "
            f"folder with {integrity.FILE}"
        )
    return found


def shipped_policies() -> list[str]:
    """The names of the shipped policies, sorted."""
    folder = asset_path(CHECKPOINTS)
    return sorted(p.name for p in folder.iterdir() if p.is_dir()) if folder.is_dir() else []


def _shipped_hint() -> str:
    """What to do when a path is not there."""
    names = shipped_policies()
    known = f"shipped policies: {', '.join(names)}" if names else "no policy is shipped yet"
    return (
        f"; {known}; give a run folder or a checkpoint in one, such as what "
        "getup-train configs/flat.yaml makes in runs/flat"
    )


def _prune(folder: Path, iteration: int, keep: int) -> None:
    """Keep `iteration` and undamaged ones before it, `keep` in all."""
    good = []
    # What cannot be read or removed now is looked at again after the next save.
    with contextlib.suppress(OSError):
        for step in reversed(steps(folder)):
            # Newer ones were damaged, or the run would have gone on from there.
            is_old = int(step.name) <= iteration
            if is_old and len(good) < keep and not integrity.is_damaged(step, LEARNER):
                good.append(step)
            else:
                integrity.remove_folder(step)


def _newest(found: list[Path], read: Callable[[Path], T]) -> T:
    """What is read of the newest checkpoint that is undamaged."""
    for older, path in reversed(list(zip([None, *found], found, strict=False))):
        try:
            return read(path)
        except DamagedError as error:
            if older is None:
                raise
            warnings.warn(f"{error}; going back to {older}", RuntimeWarning, stacklevel=3)
    raise CheckpointError("no checkpoint given")


def _read_policy(path: Path) -> LoadedPolicy:
    nested, metadata = _read(path, POLICY)
    prior, critic = nested.get("prior"), nested.get("critic")
    return LoadedPolicy(nested["policy"], prior, _read_config(path), metadata, path, critic)


def _read_learner(path: Path) -> tuple[Path, dict[str, Any], dict[str, Any]]:
    return path, *_read(path, LEARNER)


def _read(path: Path, item: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """Arrays and metadata of one item, after every file of it was checked."""
    metadata = integrity.verify(path, item)
    try:
        return read_item(path / item), metadata
    except Exception as error:
        problem = " ".join(str(error).split())
        raise DamagedError(path / item, f"cannot be read: {problem}") from error


def _read_config(path: Path) -> Config:
    file = integrity.verify_config(path)
    try:
        return load_saved_config(file)
    except BrokenFileError as error:
        raise DamagedError(file, error.problem) from None
    except ConfigError as error:
        hint = "it was written with other settings; use the version of getup_jax that wrote it"
        raise CheckpointError(f"{path}: {error}; {hint}") from None


def _write(
    final: Path,
    items: Mapping[str, dict[str, Any]],
    config: Config,
    metadata: Mapping[str, Any],
    max_bytes: int | None = None,
) -> None:
    """Write a checkpoint folder, all or nothing."""
    final = final.absolute()
    partial = final.parent / f"{integrity.PARTIAL}{final.name}"
    try:
        if processes.is_first():
            final.parent.mkdir(parents=True, exist_ok=True)
            integrity.remove_unfinished(final.parent)
            partial.mkdir()
        for name, nested in items.items():
            write_item(partial / name, nested)
        if processes.is_first():
            (partial / integrity.CONFIG).write_text(dump_yaml(config), encoding="utf-8")
            size = integrity.write(partial, metadata)
            if max_bytes is not None and size > max_bytes:
                raise ValueError(f"{size} bytes, at most {max_bytes} are allowed")
            integrity.replace_folder(partial, final)
    except Exception as error:
        shutil.rmtree(partial, ignore_errors=True)
        hint = "free disk space or choose another folder; earlier checkpoints are untouched"
        raise CheckpointError(f"{final}: could not be saved: {error}; {hint}") from error
