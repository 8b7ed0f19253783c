"""YAML files and `section.key=value` overrides into a Config, and back.

A YAML file holds only what differs from the defaults in `config/`. Values convert by
the annotation of their field, so 3e-4 is a number although PyYAML reads it as text.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Hashable, Sequence
from pathlib import Path
from typing import Any

import yaml

from getup_jax.config import Config, ConfigError
from getup_jax.config.earlier import completed
from getup_jax.convert import Text, describe, section
from getup_jax.paths import config_path, shipped_configs


def load_config(path: str | Path | None, overrides: Sequence[str] = ()) -> Config:
    """The defaults, changed by a YAML file (None: by none) and then by overrides.

    A key that a saved config lacks means what was so when it was saved, see config/earlier.py.
    Raises ConfigError that names the key, or the file and line.
    """
    file = None if path is None else find_config(path)
    from_file = {} if file is None else completed(_read_yaml(file))
    try:
        merged = functools.reduce(_merge, map(_parse_override, overrides), from_file)
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
    shipped = ", ".join(shipped_configs())
    raise ConfigError(f"{path}: no such config file; the shipped configs are: {shipped}")


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value):
        return to_dict(value)
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    if isinstance(value, dict):
        return {name: _plain(item) for name, item in value.items()}
    return value


class _Loader(yaml.SafeLoader):
    """A safe loader for which a key given twice is an error, not a silent choice."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        """As the parent's, after a check for repeated keys."""
        seen = set()
        for key in (key for key, _ in node.value if isinstance(key, yaml.ScalarNode)):
            if key.value in seen:
                problem = f"the key {key.value!r} appears twice"
                raise yaml.MarkedYAMLError(problem=problem, problem_mark=key.start_mark)
            seen.add(key.value)
        return super().construct_mapping(node, deep)


def _read_yaml(file: Path) -> dict[str, Any]:
    """The mapping in a YAML file; an empty file is an empty mapping."""
    try:
        values = yaml.load(file.read_text(encoding="utf-8"), Loader=_Loader)
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else "?"
        raise ConfigError(f"{file}, line {line}: broken YAML: {error.problem}") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ConfigError(f"{file}: not a YAML text file: {error}") from None
    if values is None:
        return {}
    if not isinstance(values, dict):
        raise ConfigError(f"{file}: expected a mapping of settings, got {describe(values)}")
    return values


def _parse_override(override: str) -> dict[str, Any]:
    """`a.b=value` as {a: {b: value}}."""
    key, equals, text = override.partition("=")
    first, *inner = names = key.strip().split(".")
    if not equals or not all(names):
        raise ConfigError(f"{override!r}: expected section.key=value, such as ppo.epochs=4")
    try:
        value: Any = yaml.load(text, Loader=_Loader)
    except yaml.YAMLError as error:
        problem = getattr(error, "problem", error)
        raise ConfigError(f"{key}: broken YAML in {text!r}: {problem}") from None
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
