"""Results of commands: an old file stays whole until the new one is there to take its place."""

from __future__ import annotations

import contextlib
import os
import uuid
from collections.abc import Iterator
from pathlib import Path


class OutputError(ValueError):
    """A result cannot be written; the text names its file and says why."""


@contextlib.contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """A file beside `path` to write into, which takes its place when the block is left.

    It has the same suffix, by which libraries choose a format. Where the block raises, Ctrl-C
    included, it is gone and an old file is as it was. A pipe or a device is written as it is.
    Raises OutputError where the disk or the folder does not take it.
    """
    path = Path(path)
    with _one_line(path):
        if path.exists() and not path.is_file():
            yield path
            return
        target = path.resolve()  # what a link points to
        part = target.with_name(f".{uuid.uuid4().hex}.part{target.suffix}")
        try:
            yield part
            os.replace(part, target)
        finally:
            with contextlib.suppress(OSError):
                part.unlink(missing_ok=True)


def write_text(path: str | Path, text: str) -> None:
    """Write a whole text file, as UTF-8; see `replacing`."""
    with replacing(path) as part:
        part.write_text(text, encoding="utf-8")


def write_bytes(path: str | Path, content: bytes) -> None:
    """Write a whole file; see `replacing`."""
    with replacing(path) as part:
        part.write_bytes(content)


def make_folder(path: Path) -> Path:
    """The folder, made with those above it where it is missing; raises OutputError."""
    with _one_line(path):
        path.mkdir(parents=True, exist_ok=True)
    return path


@contextlib.contextmanager
def _one_line(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        said = error.strerror or str(error) or type(error).__name__
        raise OutputError(f"{path}: cannot be written: {said}; choose another place") from error
