"""Trained priors on disk, found by a hash of what they were trained from."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from flax.traverse_util import flatten_dict, unflatten_dict

from getup_jax.config import PriorConfig
from getup_jax.pose_prior.data import PoseSet
from getup_jax.pose_prior.prior import PosePrior, from_dict, to_dict
from getup_jax.pose_prior.training import PriorReport, train_prior

# Raise it whenever the same poses and settings would give another prior, or the files change.
FORMAT = 1

# Settings that came later, and what older priors were made with: they keep their names.
_LATER = {"last_rate": 1.0, "weight_decay": 0.0, "input_noise": 0.0, "mirror": False}

_DECIMALS = 3  # of the statistics (rad, m) that tell one set of poses from another

Log = Callable[[str], None]

_DAMAGED = (OSError, EOFError, ValueError, TypeError, KeyError, zipfile.BadZipFile)


def cached_prior(
    poses: PoseSet,
    config: PriorConfig,
    folder: Path,
    log: Log = print,
    shipped: Path | None = None,
) -> tuple[PosePrior, PriorReport]:
    """The prior of these poses and settings: shipped, read from `folder`, or trained now.

    A newly trained one is written to `folder`. A file that cannot be read is reported and made
    again. Raises OSError where `folder` cannot be written.
    """
    name = f"prior-{fingerprint(poses, config)}.npz"
    for path in (place / name for place in (shipped, folder) if place is not None):
        if path.exists():
            try:
                return load_prior(path)
            except _DAMAGED as error:
                log(f"warning: {path}: damaged, trained again ({error})")
    log(f"training the pose prior on {len(poses.angles)} poses")
    prior, report = train_prior(poses, config, lambda *call: log(_progress_line(*call)))
    save_prior(folder / name, prior, report)
    log(f"pose prior: {report.heldout_rmse_deg:.2f} degrees off on held-out poses, {folder / name}")
    return prior, report


def fingerprint(poses: PoseSet, config: PriorConfig) -> str:
    """16 hexadecimal digits of a hash of the poses' statistics and of every setting.

    The statistics are rounded, since the last bits of a pose differ between processors, and a prior
    that is shipped must be found on all of them.
    """
    image = poses.mirror if config.mirror else None
    settings = [FORMAT, _settings(config, image is not None), poses.angles.shape]
    digest = hashlib.sha256(json.dumps(settings).encode())
    names = [field.name for field in dataclasses.fields(poses) if field.name != "mirror"]
    arrays = {name: np.asarray(getattr(poses, name)) for name in names}
    if image is not None:
        arrays |= {"mirror_index": np.asarray(image.index), "mirror_sign": np.asarray(image.sign)}
    for name, array in arrays.items():
        digest.update(f"{name} {array.shape}".encode())
        if array.dtype.kind == "f":
            moments = [array.mean(axis=0, dtype=np.float64), array.std(axis=0, dtype=np.float64)]
            array = np.round(moments, _DECIMALS) + 0.0  # adding 0 turns -0 into 0
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()[:16]


def _settings(config: PriorConfig, mirrored: bool) -> dict[str, Any]:
    """All settings but later ones that are as they were before."""
    values = dataclasses.asdict(config) | {"mirror": mirrored}
    return {name: x for name, x in values.items() if name not in _LATER or x != _LATER[name]}


def save_prior(path: Path, prior: PosePrior, report: PriorReport) -> None:
    """Write PATH.npz with the arrays and PATH.json with the report, each all or nothing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    text = json.dumps(dataclasses.asdict(report), indent=2) + "\n"
    _replace(path.with_suffix(".json"), lambda file: file.write(text.encode()))
    arrays: Any = flatten_dict(to_dict(prior), sep="/")
    # The arrays last: they are what a reader looks for.
    _replace(path, lambda file: np.savez(file, **arrays))


def load_prior(path: Path) -> tuple[PosePrior, PriorReport]:
    """What `save_prior` wrote. Raises many kinds of errors where a file is damaged or missing."""
    with np.load(path) as arrays:
        prior = from_dict(unflatten_dict(dict(arrays), sep="/"))
    report = PriorReport(**json.loads(path.with_suffix(".json").read_text()))
    return prior, report


def _replace(path: Path, write: Callable[[Any], Any]) -> None:
    """Write beside `path` and move into place, so that no reader sees half a file."""
    partial = path.with_name(f"{path.name}.{os.getpid()}.partial")
    try:
        with partial.open("wb") as file:
            write(file)
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def _progress_line(epoch: int, epochs: int, terms: dict[str, float]) -> str:
    parts = ", ".join(f"{name} {value:.2e}" for name, value in terms.items())
    return f"pose prior: epoch {epoch} of {epochs}, {parts}"
