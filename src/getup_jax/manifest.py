"""checkpoint.json: what a checkpoint folder holds, and whether all of it is still there."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from getup_jax import __version__
from getup_jax.storage import CheckpointError

FILE = "checkpoint.json"
FORMAT = "getup_jax checkpoint"
VERSION = 1  # raised when older readers could no longer read it
PARTIAL, _REMOVED = ".getup-partial-", ".getup-removed-"  # folders of an unfinished change


class DamagedError(CheckpointError):
    """A checkpoint was once whole and is not now; an older one may do."""


def is_checkpoint(folder: Path) -> bool:
    """Whether the folder itself is a checkpoint."""
    return (folder / FILE).is_file()


def write(folder: Path, metadata: Mapping[str, Any]) -> int:
    """Write checkpoint.json for the items in `folder`; returns the folder's size in bytes.

    All files are on the disk when it returns.
    """
    files = sorted(file for item in folder.iterdir() if item.is_dir() for file in _files(item))
    content = {
        "format": FORMAT,
        "version": VERSION,
        "package": __version__,
        "metadata": dict(metadata),
        "files": {file.relative_to(folder).as_posix(): _digest(file) for file in files},
    }
    (folder / FILE).write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    for path in [*folder.rglob("*"), folder]:
        _flush(path)
    return sum(file.stat().st_size for file in _files(folder))


def verify(folder: Path, item: str) -> dict[str, Any]:
    """The metadata, after a check of every file of `item` against its digest.

    Raises DamagedError naming the file, or CheckpointError for another format.
    """
    content = _content(folder / FILE)
    files = {name: digest for name, digest in content["files"].items() if _item(name) == item}
    if not files:
        raise CheckpointError(f"{folder}: has no item {item!r}; give a checkpoint of a run folder")
    for name, digest in files.items():
        file = folder / name
        if not file.is_file():
            raise DamagedError(f"{file}: is missing; the checkpoint is damaged")
        found = _digest(file)
        if found["bytes"] != digest["bytes"]:
            sizes = f"expected {digest['bytes']} bytes, got {found['bytes']}"
            raise DamagedError(f"{file}: {sizes}; the checkpoint is damaged")
        if found != digest:
            raise DamagedError(f"{file}: its content has changed; the checkpoint is damaged")
    return content["metadata"]


def is_damaged(folder: Path, item: str) -> bool:
    """Whether `verify` finds damage; a checkpoint of another version has none."""
    try:
        verify(folder, item)
    except CheckpointError as error:
        return isinstance(error, DamagedError)
    return False


def replace_folder(new: Path, final: Path) -> None:
    """Rename `new` to `final`; a folder that was there is removed afterwards."""
    aside = final.parent / f"{_REMOVED}{final.name}"
    if final.exists():
        final.rename(aside)
    new.rename(final)
    _flush(final.parent)
    shutil.rmtree(aside, ignore_errors=True)


def remove_folder(folder: Path) -> None:
    """Remove a checkpoint; at no time is there half of one under its name."""
    aside = folder.parent / f"{_REMOVED}{folder.name}"
    folder.rename(aside)
    shutil.rmtree(aside, ignore_errors=True)


def remove_unfinished(parent: Path) -> None:
    """Remove what an interrupted save left behind."""
    for folder in parent.iterdir():
        if folder.name.startswith((PARTIAL, _REMOVED)):
            shutil.rmtree(folder)


def _content(file: Path) -> dict[str, Any]:
    """The parsed checkpoint.json, of a format and version that can be read here."""
    if not file.is_file():
        raise DamagedError(f"{file}: is missing; the folder is no checkpoint, or a damaged one")
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except ValueError as error:
        raise DamagedError(f"{file}: is not JSON: {error}; the checkpoint is damaged") from None
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise CheckpointError(f"{file}: expected format {FORMAT!r}; this is no checkpoint of ours")
    if content.get("version") != VERSION:
        problem = f"expected version {VERSION}, got {content.get('version')}"
        raise CheckpointError(f"{file}: {problem}; use getup_jax {content.get('package', '?')}")
    return content


def _item(name: str) -> str:
    return name.partition("/")[0]


def _files(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_file()]


def _digest(file: Path) -> dict[str, Any]:
    with file.open("rb") as stream:
        digest = hashlib.file_digest(stream, "sha256").hexdigest()
    return {"bytes": file.stat().st_size, "sha256": digest}


def _flush(path: Path) -> None:
    """Have the system write a file or folder to the disk."""
    if os.name == "nt" and path.is_dir():
        return  # Windows cannot open folders
    descriptor = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
