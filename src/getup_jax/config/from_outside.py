"""What code that users registered raises, as one line that names its setting and its place."""

from __future__ import annotations

import contextlib
import traceback
from collections.abc import Iterator
from pathlib import Path

from getup_jax.config.check import ConfigError

_PACKAGE = str(Path(__file__).resolve().parents[1])
_LONGEST = 200  # characters of what it said


@contextlib.contextmanager
def from_outside(key: str) -> Iterator[None]:
    """Turn what a user's function or class raises into a ConfigError of one line.

    `key` is that of the setting that names the code, and the function's name. A ConfigError passes
    as it is; the cause stays in `__cause__`.
    """
    try:
        yield
    except ConfigError:
        raise
    except Exception as error:  # whatever somebody's code does
        lines = str(error).strip().splitlines() or ["without a word"]
        said = f"{type(error).__name__}: {lines[0][:_LONGEST]}"
        raise ConfigError(f"{key}: raised {said}{_place(error)}") from error


def _place(error: Exception) -> str:
    """Where the error came through the first file that is not this package's; else nothing."""
    frames = traceback.extract_tb(error.__traceback__)
    outside = [frame for frame in frames if not frame.filename.startswith(_PACKAGE)]
    if not outside:
        return ""
    file = outside[0].filename
    line = [frame.lineno for frame in outside if frame.filename == file][-1]
    return f" ({Path(file).name}, line {line})"
