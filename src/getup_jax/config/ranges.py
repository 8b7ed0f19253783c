"""The range of every number in the settings, declared beside its default.

    num_envs: int = number(512, least=1, most=131_072)
    learning_rate: tuple[float, ...] = number((1e-4, 2e-5), least=0, most=1, length=2)

A bound is part of the range (`least`, `most`) or just outside of it (`above`, `below`). An
infinity is allowed only where a bound is one; NaN nowhere.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import numbers
import types
import typing
from collections.abc import Iterator, Mapping
from typing import Any, TypeVar

from getup_jax.config.check import ConfigError, shown

LAST_SEED = 2**32 - 1  # of JAX's keys
MOST_COUNT = 2**31 - 1  # of the counters on the device, which are int32
MOST_SAMPLES = 2**21  # of an iteration: their observations alone are some GB

Length = int | tuple[int, int]  # of a list: so many numbers, or from so many to so many
T = TypeVar("T")

_KEY = "range"  # of the range in a field's metadata
_WORDS = {int: "a whole number", float: "a number"}


@dataclasses.dataclass(frozen=True)
class Range:
    """What one number may be, and of a list how many there may be; None: no bound."""

    least: float | None = None
    above: float | None = None
    most: float | None = None
    below: float | None = None
    length: Length | None = None

    def allows(self, value: Any) -> bool:
        """Whether a number is in the range; NaN is in none that has a bound."""
        return (
            (self.least is None or value >= self.least)
            and (self.above is None or value > self.above)
            and (self.most is None or value <= self.most)
            and (self.below is None or value < self.below)
        )

    def __str__(self) -> str:
        if self.least is not None and self.most is not None:
            return f"from {_bound(self.least)} to {_bound(self.most)}"
        words = (("at least", self.least), ("more than", self.above))
        words += (("at most", self.most), ("less than", self.below))
        return " and ".join(f"{word} {_bound(x)}" for word, x in words if x is not None)


def number(
    default: T,
    *,
    least: float | None = None,
    above: float | None = None,
    most: float | None = None,
    below: float | None = None,
    length: Length | None = None,
) -> T:
    """A dataclass field with its default and its range, for `check_numbers`.

    The range is that of every number in it where the field is a list or a mapping of numbers;
    None, where it is a default, is in every range.
    """
    metadata = {_KEY: Range(least, above, most, below, length)}
    field: Any = dataclasses.field(default=default, metadata=metadata)
    if isinstance(default, dict):
        field = dataclasses.field(default_factory=default.copy, metadata=metadata)
    return field


def range_of(field: dataclasses.Field[Any]) -> Range | None:
    """The range that a field was declared with, or None."""
    return field.metadata.get(_KEY)


def check_numbers(section: Any, key: str) -> None:
    """Raise ConfigError, naming `key`.NAME, for a number of a section that is out of range."""
    check_values(type(section), {n: getattr(section, n) for n in _declared(type(section))}, key)


def check_values(cls: type, values: Mapping[str, Any], key: str) -> None:
    """As `check_numbers`, of a section that is not made yet: some of its values by name."""
    for name, declared in _declared(cls).items():
        if name in values:
            declared.check(values[name], f"{key}.{name}" if key else name)


def check(value: Any, kind: type, allowed: Range, key: str) -> None:
    """Raise ConfigError unless a number (int or float) is in its range."""
    real = numbers.Integral if kind is int else numbers.Real
    if isinstance(value, bool) or not isinstance(value, real) or not allowed.allows(value):
        raise ConfigError(f"{key}: expected {_WORDS[kind]} {allowed}, got {shown(value)}")


@functools.cache
def field_types(cls: type) -> dict[str, Any]:
    """The annotations of a section's fields by name, as objects."""
    return typing.get_type_hints(cls)


@dataclasses.dataclass(frozen=True)
class _Declared:
    """A field of numbers: int or float, one or a tuple or dict of them, and their range."""

    kind: type
    container: type | None  # None: a single number
    optional: bool
    allowed: Range

    def check(self, value: Any, key: str) -> None:
        """Raise ConfigError, naming `key` or an item of it, for a value that does not fit."""
        if self.optional and value is None:
            return
        if self.container is tuple and isinstance(value, list | tuple):
            _check_length(value, self.allowed, key)
            items = [(f"{key}[{index}]", item) for index, item in enumerate(value)]
        elif self.container is dict and isinstance(value, Mapping):
            items = [(f"{key}.{name}", item) for name, item in value.items()]
        elif self.container is not None:
            form = "a list" if self.container is tuple else "a mapping"
            raise ConfigError(f"{key}: expected {form} of numbers, got {shown(value)}")
        else:
            items = [(key, value)]
        for name, item in items:
            check(item, self.kind, self.allowed, name)


@functools.cache
def _declared(cls: type) -> dict[str, _Declared]:
    """The fields that were declared with `number`, by name."""
    hints = field_types(cls)
    ranges = ((f.name, range_of(f)) for f in dataclasses.fields(cls))
    return {name: _declaration(hints[name], allowed) for name, allowed in ranges if allowed}


def _declaration(hint: Any, allowed: Range) -> _Declared:
    """What an annotation such as `tuple[float, ...] | None` says of its numbers."""
    parts = set(_parts(hint))
    kind = next((kind for kind in (float, int) if kind in parts), None)
    if kind is None:
        raise TypeError(f"{hint}: has a range, but holds no numbers")
    origins = {typing.get_origin(part) for part in parts}
    container = next((origin for origin in (tuple, dict) if origin in origins), None)
    return _Declared(kind, container, types.NoneType in parts, allowed)


def _parts(hint: Any) -> Iterator[Any]:
    yield hint
    for arg in typing.get_args(hint):
        yield from _parts(arg)


def _check_length(value: list[Any] | tuple[Any, ...], allowed: Range, key: str) -> None:
    length = len(value) if allowed.length is None else allowed.length
    least, most = length if isinstance(length, tuple) else (length, length)
    if not least <= len(value) <= most:
        count = f"{least}" if least == most else f"{least} to {most}"
        raise ConfigError(
            f"{key}: expected {count} numbers {allowed}, got {len(value)}: {shown(list(value))}"
        )


def _bound(value: float) -> str:
    return str(value) if isinstance(value, int) or not math.isfinite(value) else f"{value:g}"
