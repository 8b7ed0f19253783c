"""Libraries that only some uses need: imported there, with what to install where they are not."""

from __future__ import annotations

import importlib
from typing import Any

from getup_jax.config import ConfigError


def load_extra(module: str, extra: str, needed_by: str) -> Any:
    """The module, or ConfigError that names the extra of this package that brings it."""
    try:
        return importlib.import_module(module)
    except ImportError:
        raise ConfigError(missing(module, extra, needed_by)) from None


def missing(module: str, extra: str, needed_by: str) -> str:
    """What to say where a module is not there."""
    name = module.partition(".")[0]
    return f"{needed_by}: needs {name}; install the extra: pip install 'getup-jax[{extra}]'"
