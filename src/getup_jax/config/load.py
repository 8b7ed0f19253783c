"""YAML files and `section.key=value` overrides into a Config, and back.

A YAML file holds only what differs from the defaults in `config/`, or from another file, its
`base`. Values convert by the annotation of their field, so 3e-4 is a number although PyYAML reads
it as text.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from getup_jax.config import Config, ConfigError, yaml_text
from getup_jax.config.check import did_you_mean, shown
from getup_jax.config.convert import Text, describe, section
from getup_jax.config.migration import migrated, refuse_old
from getup_jax.core.resources import config_path, shipped_configs

BASE = "base"  # the key by which a file names another one that it changes
_DEEPEST = 10  # names in the key of an override


def load_config(path: str | Path | None, overrides: Sequence[str] = ()) -> Config:
    """The defaults, changed by a YAML file (None: by none) and then by overrides.

    A saved config means what it did when it was saved, see config/migration.py.
    Raises ConfigError that names the key, or the file and line.
    """
    file = None if path is None else find_config(path)
    return _build(file, {} if file is None else _migrated(file, _read_with_base(file)), overrides)


def load_saved_config(file: Path) -> Config:
    """What `dump_yaml` wrote, also in an earlier version."""
    return _build(file, _migrated(file, _read_yaml(file)), ())


def _migrated(file: Path, values: dict[str, Any]) -> dict[str, Any]:
    try:
        return migrated(values)
    except ConfigError as error:
        raise ConfigError(f"{error} (in {file})") from None


def _build(file: Path | None, from_file: dict[str, Any], overrides: Sequence[str]) -> Config:
    try:
        merged = functools.reduce(_merge, map(_parse_override, overrides), from_file)
        refuse_old(merged)
        return section(merged, Config, "", None)
    except ConfigError as error:
        if file is None or not _is_bad(from_file):
            raise
        raise ConfigError(f"{error} (in {file})") from None


def to_dict(config: Any) -> dict[str, Any]:
    """A (sub-)config as plain dicts, lists and scalars: what `dump_yaml` writes."""
    return {f.name: _plain(getattr(config, f.name)) for f in dataclasses.fields(config)}


def dump_yaml(config: Config) -> str:
    """Every setting as YAML text; `load_config` of it gives an equal Config."""
    return yaml.safe_dump(to_dict(config), sort_keys=False, default_flow_style=None, width=100)


def find_config(path: str | Path) -> Path:
    """The file at `path`, else the shipped config of that name; ConfigError if neither."""
    for candidate in (Path(path), config_path(path)):
        if candidate.is_file():
            return candidate
    if str(path) and Path(path).exists():  # a folder, a pipe, a device
        kind = "a folder" if Path(path).is_dir() else "no regular file"
        raise ConfigError(f"{path}: is {kind}; expected a YAML file, or a shipped config's name")
    shipped = shipped_configs()
    hint = did_you_mean(Path(path).stem, shipped, "; ")
    raise ConfigError(
        f"{path}: no such config file{hint or ';'} the shipped configs are: {', '.join(shipped)}"
    )


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value):
        return to_dict(value)
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    if isinstance(value, dict):
        return {name: _plain(item) for name, item in value.items()}
    return value


def _read_yaml(file: Path) -> dict[str, Any]:
    """The mapping in a YAML file; an empty file is an empty mapping."""
    values = yaml_text.read(file)
    if values is None:
        return {}
    if not isinstance(values, dict):
        raise ConfigError(f"{file}: expected a mapping of settings, got {describe(values)}")
    return values


def _read_with_base(file: Path, above: tuple[Path, ...] = ()) -> dict[str, Any]:
    """The mapping in a YAML file, laid over that of its base; `above`: the files based on it."""
    if file.resolve() in above:
        raise ConfigError(f"{file}: {BASE}: comes back to itself; expected another file")
    values = _read_yaml(file)
    name = values.pop(BASE, None)
    if name is None:
        return values
    if not isinstance(name, str):
        raise ConfigError(f"{file}: {BASE}: expected the name of a config, got {describe(name)}")
    beside = file.parent / (name if name.endswith(".yaml") else f"{name}.yaml")
    try:
        base = beside if beside.is_file() else find_config(name)
    except ConfigError as error:
        raise ConfigError(f"{file}: {BASE}: {error}") from None
    return _merge(_read_with_base(base, (*above, file.resolve())), values)


def _parse_override(override: str) -> dict[str, Any]:
    """`a.b=value` as {a: {b: value}}."""
    if not isinstance(override, str):  # from Python, where a list is easily one too many
        raise ConfigError(
            f"overrides: expected texts, each of section.key=value, got {describe(override)}"
        )
    key, equals, text = override.partition("=")
    first, *inner = names = key.strip().split(".")
    if not equals or not all(names) or len(names) > _DEEPEST:
        raise ConfigError(f"{shown(override)}: expected section.key=value, such as ppo.epochs=4")
    try:
        value: Any = yaml_text.parse(text)
    except yaml_text.YamlError as error:
        raise ConfigError(f"{key}: broken YAML in {shown(text)}: {error}") from None
    if value is not None and not isinstance(value, dict | list):
        value = Text(text, value)
    for name in reversed(inner):
        value = {name: value}
    return {first: value}


def _merge(base: Any, change: Any) -> Any:
    """`change` laid over `base`: mappings merge key by key, anything else replaces."""
    if not isinstance(base, dict) or not isinstance(change, dict):
        return change
    both = {name: _merge(base[name], value) for name, value in change.items() if name in base}
    return base | change | both


def _is_bad(values: dict[str, Any]) -> bool:
    try:
        section(values, Config, "", None)
    except ConfigError:
        return True
    return False
