"""The error of a wrong setting, and how its text shows what came."""

from __future__ import annotations

import difflib
import reprlib
from collections.abc import Iterable
from typing import Any

_LARGE = 10**15  # whole numbers from here on are shown by their first digits


class ConfigError(ValueError):
    """A setting is unknown, of the wrong type, or impossible; the text names its key."""


def require(ok: bool, key: str, expected: str, got: object) -> None:
    """Raise ConfigError unless ok."""
    if not ok:
        raise ConfigError(f"{key}: expected {expected}, got {shown(got)}")


def did_you_mean(name: str, known: Iterable[str], before: str = "") -> str:
    """`before` and the known name that is most like it, as a question; empty where none is."""
    close = difflib.get_close_matches(name, list(known), n=1)
    return f"{before}did you mean {close[0]!r}?" if close else ""


def shown(value: Any) -> str:
    """A value for an error text, cut where it is long."""
    if isinstance(value, int) and abs(value) >= _LARGE:
        return f"{float(value):g}" if value.bit_length() < 1024 else "a number of over 308 digits"
    return _Short().repr(value)


class _Short(reprlib.Repr):
    """The builtin repr, but for what would fill a screen."""

    def __init__(self) -> None:
        super().__init__()
        self.maxlevel, self.maxstring, self.maxother = 4, 60, 60
        self.maxlist = self.maxtuple = self.maxdict = 12

    def repr_int(self, x: int, level: int) -> str:
        return shown(x) if abs(x) >= _LARGE else str(x)
