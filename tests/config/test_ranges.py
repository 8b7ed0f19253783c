from __future__ import annotations

import dataclasses
import math
import typing
from collections.abc import Iterator
from typing import Any

import pytest

from getup_jax.config import (
    CompositeConfig,
    Config,
    ConfigError,
    CurriculumConfig,
    GroupConfig,
    PriorConfig,
    TerrainConfig,
)
from getup_jax.config.check import shown
from getup_jax.config.convert import section
from getup_jax.config.load import to_dict
from getup_jax.config.ranges import Range, check_numbers, number, range_of

GROUP = GroupConfig(links=("full",), clips=("walk",))
# every optional section is in one of them, so that the walk comes to all of them
GROUND = Config(prior=PriorConfig(), curriculum=CurriculumConfig(), terrain=TerrainConfig())
GROUPS = Config(composite=CompositeConfig(groups={"body": GROUP}, weights={"body": 1.0}))
ODD = (0, -1, 1e300, math.inf, -math.inf, math.nan, 10**4000, "many", True, None, [], {})


def hints_below(hint: Any) -> Iterator[Any]:
    yield hint
    for arg in typing.get_args(hint):
        yield from hints_below(arg)


def number_fields(cls: type) -> dict[str, dataclasses.Field[Any]]:
    """The fields of a section whose annotation holds an int or a float."""
    hints = typing.get_type_hints(cls)
    fields = {f.name: f for f in dataclasses.fields(cls)}
    return {n: f for n, f in fields.items() if {int, float} & set(hints_below(hints[n]))}


def sections(value: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    """Every section of a config with its key, those in mappings too."""
    if dataclasses.is_dataclass(value):
        yield key, value
        value = {f.name: getattr(value, f.name) for f in dataclasses.fields(value)}
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from sections(inner, f"{key}.{name}".strip("."))


SECTIONS = dict([*sections(GROUND), *sections(GROUPS)])
NUMBERS = [(key, name) for key, part in SECTIONS.items() for name in number_fields(type(part))]


def test_the_walk_comes_to_every_section():
    classes = {type(part) for part in SECTIONS.values()}
    below = {
        hint
        for cls in classes
        for inner in typing.get_type_hints(cls).values()
        for hint in hints_below(inner)
        if dataclasses.is_dataclass(hint)
    }
    assert below <= classes
    assert len(NUMBERS) > 80


@pytest.mark.parametrize(("key", "name"), NUMBERS)
def test_every_number_has_both_bounds(key, name):
    allowed = range_of(number_fields(type(SECTIONS[key]))[name])
    assert allowed is not None, f"{key}.{name}: declare it with number(...)"
    assert (allowed.least is None) != (allowed.above is None)
    assert (allowed.most is None) != (allowed.below is None)
    listed = isinstance(getattr(SECTIONS[key], name), tuple)
    assert (allowed.length is not None) == listed


def changed(key: str, value: Any) -> dict[str, Any]:
    """A config as plain values with one of them replaced, or with an element of its list."""
    values = inner = to_dict(GROUPS if key.startswith("composite") else GROUND)
    *parents, name = key.split(".")
    for parent in parents:
        inner = inner[parent]
    if isinstance(inner[name], list) and not isinstance(value, list):
        value = [value, *inner[name][1:]]
    inner[name] = value
    return values


@pytest.mark.parametrize(("key", "name"), NUMBERS)
def test_an_odd_value_is_an_error_of_its_key_or_a_config(key, name):
    full = f"{key}.{name}".strip(".")
    built = []
    for odd in ODD:
        try:
            built.append((odd, section(changed(full, odd), Config, "", None)))
        except ConfigError as error:
            text = str(error)
            assert full in text.partition(": expected")[0]
            assert "\n" not in text
            assert len(text) < 250
    endless = number_fields(type(SECTIONS[key]))[name].metadata["range"].most == math.inf
    allowed = (0, -1, None, [], {}, *((1e300, math.inf) if endless else ()))
    assert all(odd in allowed and isinstance(made, Config) for odd, made in built)


def test_a_section_made_in_python_is_checked_too():
    for key, name in NUMBERS:
        part = SECTIONS[key]
        value = getattr(part, name)
        bad = (math.nan,) * len(value) if isinstance(value, tuple) else math.nan
        bad = {"x": math.nan} if isinstance(value, dict) else bad
        with pytest.raises(ConfigError, match=rf"\b{name}\b.*: expected .*, got nan"):
            dataclasses.replace(part, **{name: bad})


@dataclasses.dataclass(frozen=True)
class Section:
    count: int = number(3, least=1, most=9)
    share: float | None = number(None, above=0, below=1)
    pair: tuple[float, ...] = number((1.0, 2.0), least=-1, most=math.inf, length=2)
    sizes: tuple[int, ...] = number((4,), least=1, most=8, length=(1, 3))
    weights: dict[str, float] = number({"a": 0.5}, least=0, most=1)

    def __post_init__(self) -> None:
        check_numbers(self, "part")


def test_a_number_is_a_field_with_its_default():
    assert (Section().count, Section().share, Section.count) == (3, None, 3)
    Section().weights["b"] = 2.0
    assert Section().weights == {"a": 0.5}


@pytest.mark.parametrize(
    "change",
    [
        {"count": 1},
        {"count": 9},
        {"share": 0.5},
        {"pair": (-1.0, math.inf)},
        {"sizes": (1, 8, 4)},
        {"weights": {}},
    ],
)
def test_bounds_belong_to_the_range(change):
    assert dataclasses.replace(Section(), **change)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"count": 0}, "part.count: expected a whole number from 1 to 9, got 0"),
        ({"count": 2.5}, "part.count: expected a whole number from 1 to 9, got 2.5"),
        ({"count": None}, "part.count: expected a whole number from 1 to 9, got None"),
        ({"share": 0.0}, "part.share: expected a number more than 0 and less than 1, got 0.0"),
        ({"share": True}, "part.share: expected a number more than 0 and less than 1, got True"),
        ({"pair": (1.0,)}, "part.pair: expected 2 numbers from -1 to inf, got 1: [1.0]"),
        ({"pair": (1.0, -2.0)}, "part.pair[1]: expected a number from -1 to inf, got -2.0"),
        ({"sizes": ()}, "part.sizes: expected 1 to 3 numbers from 1 to 8, got 0: []"),
        ({"weights": {"b": 2}}, "part.weights.b: expected a number from 0 to 1, got 2"),
    ],
)
def test_the_message_names_the_key_the_range_and_what_came(change, message):
    with pytest.raises(ConfigError) as caught:
        dataclasses.replace(Section(), **change)
    assert str(caught.value) == message


def test_a_range_without_numbers_is_a_mistake_of_ours():
    wrong = dataclasses.make_dataclass("Wrong", [("x", str, number("a", least=0, most=1))])
    with pytest.raises(TypeError, match="holds no numbers"):
        check_numbers(wrong(), "part")


@pytest.mark.parametrize("value", [0.0, 1.0, math.nan, math.inf])
def test_nothing_outside_is_allowed(value):
    assert not Range(above=0, below=1).allows(value)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (131072, "131072"),
        (10**20, "1e+20"),
        (-(10**4000), "a number of over 308 digits"),
        ("x" * 99, f"'{'x' * 27}...{'x' * 28}'"),
        ([[[[[1]]]]], "[[[[[...]]]]]"),
        ([16**5000], "[a number of over 308 digits]"),
    ],
)
def test_what_is_long_is_cut(value, text):
    assert shown(value) == text
