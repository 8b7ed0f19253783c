"""checkpoint.json: what a checkpoint folder holds, and whether all of it is as it was saved.

It has the digest of every array file, of config.yaml, and of its own content. Checkpoints that
were saved before it had the last two load without them.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import Any

from getup_jax import __version__
from getup_jax.config.check import shown
from getup_jax.runtime.pytree_store import CheckpointError

FILE = "checkpoint.json"
FORMAT = "getup_jax checkpoint"
VERSION = 1  # raised when older readers could no longer read it
CONFIG = "config.yaml"
_SEAL = "content_sha256"  # digest of all the rest of checkpoint.json
_KEYS = {"format": str, "version": int, "package": str, "metadata": dict, "files": dict}
_HINT = "the checkpoint is damaged; use another one, or a copy of this one"
PARTIAL, _REMOVED = ".getup-partial-", ".getup-removed-"  # folders of an unfinished change


class DamagedError(CheckpointError):
    """A checkpoint was once whole and is not now; an older one may do.

    The text names the file, what is wrong with it, and what to do.
    """

    def __init__(self, file: Path, problem: str) -> None:
        super().__init__(f"{file}: {problem}; {_HINT}")


def is_checkpoint(folder: Path) -> bool:
    """Whether the folder itself is a checkpoint."""
    return (folder / FILE).is_file()


def write(folder: Path, metadata: Mapping[str, Any]) -> int:
    """Write checkpoint.json for what is in `folder`; returns the folder's size in bytes.

    All files are on the disk when it returns.
    """
    files = sorted(file for item in folder.iterdir() if item.is_dir() for file in _files(item))
    files += [folder / CONFIG] if (folder / CONFIG).is_file() else []
    content = {
        "format": FORMAT,
        "version": VERSION,
        "package": __version__,
        "metadata": dict(metadata),
        "files": {file.relative_to(folder).as_posix(): _digest(file) for file in files},
    }
    text = json.dumps(sealed(content), indent=1) + "\n"
    (folder / FILE).write_text(text, encoding="utf-8")
    for path in [*folder.rglob("*"), folder]:
        _flush(path)
    return sum(file.stat().st_size for file in _files(folder))


def sealed(content: Mapping[str, Any]) -> dict[str, Any]:
    """The content of a checkpoint.json with the digest of all the rest of it."""
    rest = {key: value for key, value in content.items() if key != _SEAL}
    text = json.dumps(rest, sort_keys=True, separators=(",", ":"))
    return {**rest, _SEAL: hashlib.sha256(text.encode()).hexdigest()}


def verify(folder: Path, item: str) -> dict[str, Any]:
    """The metadata, after a check of every file of `item` against its digest.

    Raises DamagedError naming the file, or CheckpointError for another format.
    """
    content = _content(folder / FILE)
    names = [name for name in content["files"] if name.partition("/")[0] == item]
    if not names:
        raise CheckpointError(f"{folder}: has no item {item!r}; give a checkpoint of a run folder")
    for name in names:
        _verify_file(folder / name, content["files"][name])
    if _SEAL not in content:
        _check_complete(folder, item, names)
    return content["metadata"]


def verify_config(folder: Path) -> Path:
    """The path of config.yaml, after a check against its digest, where there is one."""
    file, files = folder / CONFIG, _content(folder / FILE)["files"]
    if CONFIG in files:
        _verify_file(file, files[CONFIG])
    if not file.is_file():
        raise DamagedError(file, "is missing")
    return file


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
        raise DamagedError(file, "is missing")
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise _unreadable(file, error) from None
    except (ValueError, RecursionError) as error:
        raise DamagedError(file, f"is not JSON ({_line(error)})") from None
    if not isinstance(content, dict):
        raise DamagedError(file, "is not a JSON object")
    if _SEAL in content and content[_SEAL] != sealed(content)[_SEAL]:
        raise DamagedError(file, "its content has changed")
    if content.get("format") != FORMAT:
        raise CheckpointError(f"{file}: expected format {FORMAT!r}; this is no checkpoint of ours")
    if content.get("version") != VERSION:
        problem = f"expected version {VERSION}, got {content.get('version')}"
        raise CheckpointError(f"{file}: {problem}; use getup_jax {content.get('package', '?')}")
    _check_keys(file, content)
    return content


def _check_keys(file: Path, content: Mapping[str, Any]) -> None:
    """What a digest does not tell of a checkpoint.json without one, or with its name changed."""
    for key in content.keys() - _KEYS.keys() - {_SEAL}:
        raise DamagedError(file, f"has the unknown key {shown(key)}")
    for key, kind in _KEYS.items():
        if not isinstance(content.get(key), kind):
            raise DamagedError(
                file, f"{key}: expected {kind.__name__}, got {shown(content.get(key))}"
            )
    if not isinstance(content["metadata"].get("iteration"), int):
        raise DamagedError(file, "metadata: has no iteration")
    for name, digest in content["files"].items():
        path = PurePosixPath(name)
        if path.is_absolute() or ".." in path.parts:
            raise DamagedError(file, f"files: {shown(name)} is outside of the checkpoint")
        if not isinstance(digest, dict) or digest.keys() != {"bytes", "sha256"}:
            raise DamagedError(file, f"files: {shown(name)}: expected bytes and sha256")


def _verify_file(file: Path, digest: Mapping[str, Any]) -> None:
    if not file.is_file():
        raise DamagedError(file, "is missing")
    try:
        found = _digest(file)
    except OSError as error:
        raise _unreadable(file, error) from None
    if found["bytes"] != digest["bytes"]:
        raise DamagedError(file, f"expected {digest['bytes']} bytes, got {found['bytes']}")
    if found != digest:
        raise DamagedError(file, "its content has changed")


def _check_complete(folder: Path, item: str, names: Sequence[str]) -> None:
    """Without a digest of its own, a name in checkpoint.json may have changed to another item's."""
    for file in sorted(_files(folder / item)):
        name = file.relative_to(folder).as_posix()
        if name not in names and not file.name.startswith("."):
            raise DamagedError(folder / FILE, f"files: does not list {name}")


def _unreadable(file: Path, error: OSError) -> CheckpointError:
    return CheckpointError(f"{file}: cannot be read: {error.strerror or error}; check its rights")


def _line(error: Exception) -> str:
    return " ".join(str(error).split())


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
