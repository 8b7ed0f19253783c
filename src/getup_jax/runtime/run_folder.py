"""A run's folder: config.yaml, metrics.jsonl, checkpoints/; who may write into it."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

from getup_jax.config import Config, ConfigError
from getup_jax.config.load import dump_yaml, load_saved_config, to_dict

CONFIG = "config.yaml"
_LOCK = ".lock"  # held by the process that trains; free again however that ends


class RunError(ValueError):
    """A run folder cannot be used as asked; the text names it and says what to do."""


def check(folder: Path, resume: bool) -> None:
    """Raise RunError if the folder holds something and the run is not to be resumed.

    Settings alone are nothing to lose: a run that failed before its first iteration left them.
    """
    if folder.exists() and not folder.is_dir():
        raise RunError(f"{folder}: is a file; choose another folder with --run FOLDER")
    if not resume and folder.is_dir() and _holds_a_run(folder):
        hint = "add --resume to continue it, or choose another folder with --run FOLDER"
        raise RunError(f"{folder}: holds a run already; {hint}")


def _holds_a_run(folder: Path) -> bool:
    return any(path.name not in (CONFIG, _LOCK) for path in folder.iterdir())


def prepare(folder: Path, config: Config, resume: bool, log: Callable[[str], None]) -> IO[str]:
    """Make the folder and write the resolved config; log the settings that a resume changes.

    Returns a file: until it is closed, the folder is this process's alone, and RunError is raised
    in others.
    """
    check(folder, resume)
    folder.mkdir(parents=True, exist_ok=True)
    held = _locked(folder)
    try:
        _write_config(folder, config, resume, log)
    except BaseException:
        held.close()
        raise
    return held


def _locked(folder: Path) -> IO[str]:
    file = open(folder / _LOCK, "a+", encoding="utf-8")  # noqa: SIM115  # closed by who holds it
    if sys.platform == "win32":  # which has no such locks
        return file
    import fcntl

    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        file.seek(0)
        with file:
            process = file.read().strip() or "unknown"
        raise RunError(
            f"{folder}: another training writes into it (process {process}); stop that one first, "
            "or choose another folder with --run FOLDER"
        ) from None
    except OSError:
        return file  # a file system without such locks
    file.truncate(0)
    file.write(str(os.getpid()))
    file.flush()
    return file


def _write_config(folder: Path, config: Config, resume: bool, log: Callable[[str], None]) -> None:
    file = folder / CONFIG
    if resume and file.exists():
        _log_changes(file, config, log)
    fresh = file.with_suffix(".new")
    fresh.write_text(dump_yaml(config), encoding="utf-8")
    os.replace(fresh, file)


def resume_command(folder: Path) -> str:
    """The command that continues the run."""
    run = shlex.quote(str(folder))
    return f"getup-train {shlex.quote(str(folder / CONFIG))} --run {run} --resume"


def _log_changes(file: Path, config: Config, log: Callable[[str], None]) -> None:
    try:
        before = _flat(to_dict(load_saved_config(file)))
    except ConfigError as error:
        log(f"the run's earlier settings cannot be read and are replaced: {error}")
        return
    now = _flat(to_dict(config))
    for key in sorted(before.keys() | now.keys()):
        if before.get(key) != now.get(key):
            log(f"resuming with {key} = {now.get(key)} instead of {before.get(key)}")


def _flat(values: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    flat = {}
    for name, value in values.items():
        inner = {prefix + name: value}
        flat |= _flat(value, f"{prefix}{name}.") if isinstance(value, dict) else inner
    return flat
