"""Plain values (of YAML or a command line) into config dataclasses, by their annotations."""

from __future__ import annotations

import dataclasses
import math
import types
import typing
from collections.abc import Mapping
from typing import Any

from getup_jax.config import ConfigError
from getup_jax.config.check import did_you_mean, shown
from getup_jax.config.ranges import Range, check_values, field_types, range_of

_LONGEST = 80  # letters that an error text shows of an unknown key
_EXPECTED = {
    int: "a whole number (int)",
    float: "a number (float)",
    bool: "true or false (bool)",
    str: "text (str)",
}


@dataclasses.dataclass(frozen=True)
class Text:
    """A scalar of the command line: its text, and what YAML makes of it."""

    text: str
    value: Any

    def __repr__(self) -> str:
        return shown(self.value)


def section(value: Any, cls: type, key: str, default: Any) -> Any:
    """A config dataclass: `default` (None: the class's defaults) changed by a mapping."""
    if not isinstance(value, Mapping):
        hint = "; leave it out for its defaults" if value is None else ""
        raise ConfigError(f"{key}: expected a mapping of settings, got {describe(value)}{hint}")
    fields = {f.name: f for f in dataclasses.fields(cls)}
    hints = field_types(cls)
    known = {name: _default(field, default) for name, field in fields.items()}
    changed = {}
    for name, item in value.items():
        inner = f"{key}.{name}" if key else str(name)
        if name not in fields:
            raise ConfigError(f"{_cut(inner)}: unknown key; {_suggest(name, fields)}")
        changed[name] = _convert(item, hints[name], inner, known[name], range_of(fields[name]))
    check_values(cls, changed, key)
    values = known | changed
    for name, item in values.items():
        if item is dataclasses.MISSING:
            raise ConfigError(f"{key}.{name}: missing; it has no default")
    return cls(**values)


def _default(field: dataclasses.Field, instance: Any) -> Any:
    if instance is not None:
        return getattr(instance, field.name)
    if field.default_factory is not dataclasses.MISSING:
        return field.default_factory()
    return field.default


def _cut(name: object) -> str:
    return str(name)[:_LONGEST]


def _suggest(name: object, known: Mapping[str, Any]) -> str:
    return did_you_mean(_cut(name), known) or f"known keys are: {', '.join(known)}"


def _convert(value: Any, hint: Any, key: str, default: Any, allowed: Range | None) -> Any:
    """`value` as the annotation `hint` asks, or ConfigError naming `key`; the error says `allowed`.

    Whether numbers are in that range is checked later, of all at once.
    """
    origin, args = typing.get_origin(hint), typing.get_args(hint)
    if origin in (typing.Union, types.UnionType):
        if value is None:
            return None
        (inner,) = (arg for arg in args if arg is not types.NoneType)
        return _convert(value, inner, key, default, allowed)
    if hint is Any:  # checked by whoever reads it
        return value.value if isinstance(value, Text) else value
    if dataclasses.is_dataclass(hint):
        same = default if isinstance(default, typing.cast(type, hint)) else None
        return section(value, typing.cast(type, hint), key, same)
    if origin is tuple:
        return _tuple(value, args, key, allowed)
    if origin is dict:
        return _dict(value, args[1], key, allowed)
    return _scalar(value, hint, key, allowed)


def _tuple(value: Any, args: tuple[Any, ...], key: str, allowed: Range | None) -> tuple[Any, ...]:
    if not isinstance(value, list | tuple):
        raise ConfigError(
            f"{key}: expected a list, got {describe(value)}; write {key}=[{shown(value)}]"
        )
    hints = [args[0]] * len(value) if args[-1] is Ellipsis else list(args)
    if len(value) != len(hints):
        raise ConfigError(f"{key}: expected {len(hints)} values, got {len(value)}: {shown(value)}")
    pairs = enumerate(zip(value, hints, strict=True))
    return tuple(_convert(item, hint, f"{key}[{i}]", None, allowed) for i, (item, hint) in pairs)


def _dict(value: Any, hint: Any, key: str, allowed: Range | None) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise ConfigError(f"{key}: expected a mapping, got {describe(value)}")
    items = value.items()
    return {str(n): _convert(item, hint, f"{key}.{n}", None, allowed) for n, item in items}


def _scalar(value: Any, hint: Any, key: str, allowed: Range | None) -> Any:
    if isinstance(value, Text):
        # `character=007` and `engine=off` are text where the field is text.
        value = value.text if hint is str and not isinstance(value.value, str) else value.value
    if hint in (bool, str) and isinstance(value, hint):
        return value
    if hint in (int, float) and (number := _number(value, hint)) is not None:
        return number
    quotes = "; put it in quotes" if hint is str and value is not None else ""
    expected = _EXPECTED[hint] if allowed is None else f"{_EXPECTED[hint]} {allowed}"
    raise ConfigError(f"{key}: expected {expected}, got {describe(value)}{quotes}")


def _number(value: Any, kind: type) -> int | float | None:
    """The number, or None where `value` is not one; 1e8 is a whole number too."""
    if isinstance(value, int) and not isinstance(value, bool) and kind is int:
        return value
    try:
        number = math.nan if isinstance(value, bool) else float(value)
    except (TypeError, ValueError, OverflowError):
        return None
    if kind is int:
        return int(number) if number.is_integer() else None
    return None if math.isnan(number) else number


def describe(value: Any) -> str:
    """What came, for an error text: the value and its type."""
    value = value.value if isinstance(value, Text) else value
    return f"{shown(value)} ({type(value).__name__})"
