"""Starts on irregular ground kept on disk, found by a hash of what they were made from."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import zipfile
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np

from getup_jax.envs.getup.resets.lying import Starts
from getup_jax.physics.character import CharacterSpec

# Raise it whenever the same model and numbers would give other starts.
FORMAT = 1

Log = Callable[[str], None]

_DAMAGED = (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile)


@dataclasses.dataclass(frozen=True)
class Request:
    """Which starts: what kind, how many, from which seed."""

    name: str
    count: int
    seed: int


Maker = Callable[[Request, Log], Starts]


def cached_starts(
    request: Request, character: CharacterSpec, make: Maker, place: Path, log: Log
) -> Starts:
    """The starts that `make(request, log)` gives for this model: read from `place`, or made now.

    character: with the ground in its model. A file that cannot be read, or that was made for
    another model, is reported and made again.
    """
    key = fingerprint(request, character)
    file = place / f"{request.name}-{key[:16]}.npz"
    if file.exists():
        try:
            return _load(file, key, character)
        except _DAMAGED as error:
            log(f"warning: {file}: made again ({error})")
    starts = make(request, log)
    _save(file, key, starts)
    return starts


def fingerprint(request: Request, character: CharacterSpec) -> str:
    """A hash of the compiled model, ground and physics settings included, and of the request."""
    model = np.zeros(mujoco.mj_sizeModel(character.model), np.uint8)
    mujoco.mj_saveModel(character.model, None, model)
    settings = [FORMAT, mujoco.__version__, dataclasses.asdict(request)]
    return hashlib.sha256(json.dumps(settings).encode() + model.tobytes()).hexdigest()


def _load(file: Path, key: str, character: CharacterSpec) -> Starts:
    with np.load(file) as data:
        found = str(data["key"])
        starts = Starts(**{f.name: data[f.name] for f in dataclasses.fields(Starts)})
    if found != key or starts.qpos.shape[1:] != (character.model.nq,):
        raise ValueError("it belongs to another model, ground, number or seed")
    return starts


def _save(file: Path, key: str, starts: Starts) -> None:
    """Write beside `file` and move into place, so that no reader sees half a file."""
    file.parent.mkdir(parents=True, exist_ok=True)
    partial = file.with_name(f"{file.stem}.{os.getpid()}.partial.npz")
    try:
        np.savez_compressed(partial, key=key, **dataclasses.asdict(starts))
        partial.replace(file)
    finally:
        partial.unlink(missing_ok=True)
