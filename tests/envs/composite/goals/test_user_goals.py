"""A goal of one's own: that of the documentation, and ones that say what is wrong with them."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from goal_samples import kinematics

import getup_jax as gj
from getup_jax.config import CompositeConfig, ConfigError, GroupConfig, PhysicsConfig
from getup_jax.envs.composite.goals.combine import GOALS, equipment_of, make_goals
from getup_jax.physics.character import load_character

PAGE = Path(__file__).resolve().parents[4] / "docs/goals.md"
SEEN = kinematics({"hand_r": (0.0, 0.0, 1.2)})
KEY = jax.random.PRNGKey(0)


@pytest.fixture(autouse=True)
def forgotten(monkeypatch):
    """What a test registers is gone after it."""
    monkeypatch.setattr(GOALS, "_found", dict(GOALS))


@pytest.fixture(scope="module")
def character():
    return load_character(PhysicsConfig(character="humanoid28"))


@dataclasses.dataclass(frozen=True)
class Good(gj.Goal):
    """Whose functions tests replace."""

    rate: float = 1
    name = "mine"
    observation_size = 1

    def reset(self, key, kinematics):
        return jnp.zeros(len(kinematics.finite))

    def step(self, key, state, kinematics):
        return state, output(jnp.ones_like(state))

    def observe(self, state, kinematics):
        return state[:, None]


def output(reward, **changes):
    known = {"terminated": reward > 2, "success": reward * jnp.nan}
    return gj.GoalOutput(reward=reward, **(known | changes))


def used(kind, character, seen=SEEN):
    """One goal through everything that training asks of it."""
    gj.register_goal(kind)
    equipment_of([kind.name])
    goals = make_goals({kind.name: {}}, character, 1 / 30)
    goals.check_numbers(seen)
    state = goals.reset(KEY, seen)
    goals.command(state, seen)
    state = goals.toward(state, seen, jnp.zeros(1))
    return goals.step(KEY, state, seen), goals.observe(state, seen)


def test_the_one_of_the_page_to_copy_is_a_goal(character):
    code = PAGE.read_text(encoding="utf-8").split("```python\n")[1].split("```")[0]
    exec(compile(code, str(PAGE), "exec", dont_inherit=True), {"__name__": "copied"})
    goals = make_goals({"hands_high": {"height": [1.1, 1.2]}}, character, 1 / 30)
    hand = character.link("hand_r")
    place = np.zeros((1, len(character.link_names), 3), np.float32)
    place[0, hand, 2] = 1.4
    seen = SEEN.replace(link_position=jnp.asarray(place))
    state = goals.reset(KEY, seen)
    (height,) = np.asarray(state[0])
    assert 1.1 <= height <= 1.2
    _, (out,) = goals.step(KEY, state, seen)
    np.testing.assert_allclose(out.reward, np.exp(-3.0 * (1.4 - height)), rtol=1e-5)
    np.testing.assert_allclose(goals.observe(state, seen), [[height]])


def test_a_number_is_not_rounded_to_the_kind_of_its_default(character):
    gj.register_goal(Good)
    (goal,) = make_goals({"mine": {"rate": 1.5}}, character, 1 / 30).goals
    assert goal.goal.rate == 1.5


def test_a_cell_may_be_run_twice_and_a_name_means_one_goal():
    gj.register_goal(Good)
    named = {"__module__": Good.__module__, "__qualname__": Good.__qualname__}
    again = type("Good", (Good,), named)
    gj.register_goal(dataclasses.dataclass(frozen=True)(again))
    assert GOALS["mine"] is not Good
    other = dataclasses.dataclass(frozen=True)(type("Other", (Good,), {}))
    with pytest.raises(ConfigError, match=r"mine: is registered .* by .*Good; choose another name"):
        gj.register_goal(other)
    taken = dataclasses.dataclass(frozen=True)(type("Taken", (Good,), {"name": "aiming"}))
    with pytest.raises(ConfigError, match=r"aiming: is registered in getup_jax\.goals already"):
        gj.register_goal(taken)


def test_an_unknown_one_says_how_goals_become_known(character):
    with pytest.raises(ConfigError, match=r"unknown 'mine'; .* entry point getup_jax\.goals"):
        make_goals({"mine": {}}, character, 1 / 30)


def test_a_goal_is_not_called_as_a_group():
    groups = {"aiming": GroupConfig(links=("full",), clips=("walk",))}
    with pytest.raises(ConfigError, match=r"composite\.groups: expected names that no goal has"):
        CompositeConfig(groups=groups, goals={"aiming": {}})


def raises(*_):
    raise KeyError("elbow")


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"name": None}, "goal Bad: name: expected the text that configs call it, got None"),
        ({"observation_size": None}, "observation_size: expected how many numbers .* got None"),
        ({"observe": gj.Goal.observe}, r"has no observe; derive it from getup_jax\.Goal"),
        ({"markers": None}, "has no markers; derive it"),
        ({"balls": 3}, r"balls: expected a tuple of .*Ball, got 3"),
        ({"links": {"hand": "hand_x"}}, "links: unknown 'hand_x'; did you mean 'hand_"),
        ({"reset": raises}, r"mine: reset: raised KeyError: 'elbow' \(test_user_goals.py, line"),
        ({"reset": lambda *_: jnp.zeros(2)}, r"reset: state: expected shape \(1, \.\.\.\).*\(2,\)"),
        ({"observe": lambda *_: jnp.zeros(1)}, r"observe: expected shape \(1, 1\), got \(1,\)"),
        ({"step": lambda *_: 1.0}, "step: expected a pair of a state and a GoalOutput, got float"),
        ({"step": lambda s, k, x, y: (x, x)}, "step: expected a GoalOutput beside the state"),
        (
            {"step": lambda s, k, x, y: (x.astype(int), output(x))},
            r"step: expected a state like the one before, .*float32\[1\].*int32\[1\]",
        ),
        (
            {"step": lambda s, k, x, y: (x, output(x[:, None], success=x, terminated=x > 2))},
            r"step: reward: expected shape \(1,\), got \(1, 1\)",
        ),
        (
            {"step": lambda s, k, x, y: (x, output(x, terminated=x))},
            "step: terminated: expected bool, got float32",
        ),
        ({"toward": lambda *_: None}, "toward: expected a state like the one before"),
        ({"command": lambda *_: 1}, "command: expected a PropCommand, for its balls, got int"),
        ({"observe": lambda s, x, y: x[:, None] / 0}, "observe: expected finite .* 1 of 1 start"),
        (
            {"step": lambda s, k, x, y: (x, output(x * jnp.inf))},
            "step: reward: expected finite numbers, got NaN or infinity in 1 of 1 start states",
        ),
    ],
)
def test_what_is_wrong_with_one_is_a_line(character, change, text):
    bad = dataclasses.dataclass(frozen=True)(type("Bad", (Good,), change))
    with pytest.raises(ConfigError) as caught:
        used(bad, character)
    assert re.search(text, str(caught.value)), str(caught.value)
    assert "mine" in str(caught.value) or "Bad" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_setting_must_have_a_number_as_default():
    @dataclasses.dataclass(frozen=True)
    class Odd(Good):
        kind: str = "fast"

    with pytest.raises(
        ConfigError, match=r"goal mine: kind: expected a number or a tuple .*'fast'"
    ):
        gj.register_goal(Odd)
    with pytest.raises(ConfigError, match=r"expected a class with @dataclasses\.dataclass"):
        gj.register_goal(type("Plain", (Good,), {}))


def test_what_it_says_later_that_is_no_number_is_in_its_reward(character):
    def observe(self, state, kinematics):
        return jnp.sqrt(kinematics.link_position[:, 0, 2])[:, None]

    bad = dataclasses.dataclass(frozen=True)(type("Bad", (Good,), {"observe": observe}))
    (_, (fine,)), _ = used(bad, character)
    assert np.isfinite(fine.reward).all()
    goals = make_goals({"mine": {}}, character, 1 / 30)
    below = kinematics({"pelvis": (0.0, 0.0, -0.1)})
    _, (out,) = goals.step(KEY, goals.reset(KEY, below), below)
    assert np.isnan(out.reward).all()
