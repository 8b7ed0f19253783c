"""Where the shipped files and the cache are, in a checkout and in an installed wheel."""

from __future__ import annotations

import os
import sys
from pathlib import Path

DEFAULT_POLICY = "getup"  # the shipped one that commands and Python begin with

_PACKAGE = Path(__file__).resolve().parent.parent
_CHECKOUT = _PACKAGE.parent.parent


def _root(name: str, package: Path = _PACKAGE, checkout: Path = _CHECKOUT) -> Path:
    """The folder `name`: inside the package (wheel), else beside `src` (checkout)."""
    packaged = package / name
    return packaged if packaged.is_dir() else checkout / name


def asset_path(*parts: str) -> Path:
    """The path of a shipped asset, such as asset_path("checkpoints", "flat").

    The path is not checked: whoever opens it knows what to say when it is missing.
    """
    return _root("assets").joinpath(*parts)


def config_path(name: str | Path) -> Path:
    """The path of a shipped config; `flat`, `flat.yaml` and `configs/flat.yaml` are one."""
    given = Path(name)
    if given.parts[:-1] == ("configs",):
        given = Path(given.name)
    return _root("configs") / (given if given.suffix == ".yaml" else f"{given}.yaml")


def shipped_configs() -> list[str]:
    """The names of the shipped configs, sorted."""
    return sorted(file.stem for file in _root("configs").glob("*.yaml"))


def cache_dir() -> Path:
    """The folder for files that can be made again; it is created.

    GETUP_JAX_CACHE where that is set, else the platform's own cache folder.
    Raises OSError where it cannot be created.
    """
    chosen = os.environ.get("GETUP_JAX_CACHE")
    folder = Path(chosen).expanduser() if chosen else _platform_cache() / "getup_jax"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        hint = "set GETUP_JAX_CACHE to a folder that can be written"
        raise OSError(f"{folder}: cannot create the cache folder: {error}; {hint}") from error
    return folder


def _platform_cache() -> Path:
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
