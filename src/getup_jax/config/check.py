"""The error of a wrong setting."""

from __future__ import annotations


class ConfigError(ValueError):
    """A setting is unknown, of the wrong type, or impossible; the text names its key."""


def require(ok: bool, key: str, expected: str, got: object) -> None:
    """Raise ConfigError unless ok."""
    if not ok:
        raise ConfigError(f"{key}: expected {expected}, got {got!r}")
