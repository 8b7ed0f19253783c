from __future__ import annotations

import dataclasses
import math

import pytest

from getup_jax.config import CompositeConfig, ConfigError, GroupConfig, PhysicsConfig
from getup_jax.config.ranges import range_of
from getup_jax.envs.composite.goals.combine import GOALS, make_goals
from getup_jax.physics.character import load_character

GROUPS = {"body": GroupConfig(links=("full",), clips=("walk",))}
SETTINGS = [
    (name, field)
    for name, goal in GOALS.items()
    for field in dataclasses.fields(goal)
    if field.default is not dataclasses.MISSING
]


@pytest.fixture(scope="module")
def character():
    return load_character(PhysicsConfig(character="humanoid28"))


@pytest.mark.parametrize(("name", "field"), SETTINGS, ids=lambda x: getattr(x, "name", x))
def test_every_setting_of_a_goal_has_a_range(character, name, field):
    allowed = range_of(field)
    assert allowed is not None
    bounds = (allowed.least, allowed.above, allowed.most, allowed.below)
    assert sum(bound is not None for bound in bounds) == 2
    assert allowed.length == (len(field.default) if isinstance(field.default, tuple) else None)
    key = rf"composite\.goals\.{name}\.{field.name}"
    for odd in (1e5, -1e5, math.inf, math.nan, "many", True, None):
        value = (odd, *field.default[1:]) if isinstance(field.default, tuple) else odd
        with pytest.raises(ConfigError, match=rf"^{key}.*: expected .*, got "):
            make_goals({name: {field.name: value}}, character, 1 / 30)
    make_goals({name: {field.name: field.default}}, character, 1 / 30)


@pytest.mark.parametrize("value", [math.inf, math.nan, "far", [1.0, math.inf], [[1.0]], {"a": 1}])
def test_what_is_no_number_is_an_error_before_anything_is_built(value):
    with pytest.raises(ConfigError, match=r"^composite\.goals\.aiming\.pitch.*: expected a number"):
        CompositeConfig(groups=GROUPS, goals={"aiming": {"pitch": value}})


def test_a_whole_number_is_not_rounded(character):
    with pytest.raises(ConfigError, match=r"juggling\.interval: expected a whole number .*20\.7"):
        make_goals({"juggling": {"interval": 20.7}}, character, 1 / 30)
