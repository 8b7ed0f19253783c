"""Any number of goals at once, and goals by the names that configs use."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from getup_jax.config import ConfigError
from getup_jax.config.from_outside import from_outside
from getup_jax.config.ranges import check_values
from getup_jax.config.registry import Registry, check_name
from getup_jax.core.types import Kinematics, PropCommand
from getup_jax.envs.composite.goals.aiming import Aiming
from getup_jax.envs.composite.goals.goal import Goal, GoalOutput, Marker
from getup_jax.envs.composite.goals.juggling import Juggling
from getup_jax.envs.composite.goals.target_heading import TargetHeading
from getup_jax.envs.composite.goals.target_location import TargetLocation
from getup_jax.envs.composite.goals.tennis_swing import TennisSwing
from getup_jax.envs.composite.goals.user_goals import CheckedGoal, check_kind
from getup_jax.physics.character import CharacterSpec
from getup_jax.physics.props import Ball, Equipment

_OWN: tuple[Any, ...] = (TargetHeading, TargetLocation, Aiming, TennisSwing, Juggling)
GOALS: Registry[Any] = Registry("getup_jax.goals", {goal.name: goal for goal in _OWN})


def register_goal(goal: type) -> type:
    """Make a goal known by its `name`; usable as a decorator.

    See docs/goals.md for what a goal is. Commands know it where a package has it as an entry point
    of the group `getup_jax.goals`. Raises ConfigError where it lacks something, or the name is
    taken.
    """
    check_kind(goal)
    GOALS.register(goal.name, goal)
    return goal


@dataclasses.dataclass(frozen=True)
class Goals:
    """Several goals as one: states and outputs in their order, observations joined."""

    goals: tuple[Goal, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the objectives."""
        return tuple(goal.name for goal in self.goals)

    @property
    def observation_size(self) -> int:
        """Numbers of all goal states together."""
        return sum(goal.observation_size for goal in self.goals)

    @property
    def balls(self) -> tuple[Ball, ...]:
        """All balls, in the order that the character must be loaded with."""
        return tuple(ball for goal in self.goals for ball in goal.balls)

    def reset(self, key: jax.Array, kinematics: Kinematics) -> tuple[Any, ...]:
        """Fresh states of all goals."""
        keys = jax.random.split(key, len(self.goals) or 1)
        return tuple(
            goal.reset(k, seen)
            for goal, k, seen in zip(self.goals, keys, self._seen(kinematics), strict=False)
        )

    def step(
        self, key: jax.Array, states: tuple[Any, ...], kinematics: Kinematics
    ) -> tuple[tuple[Any, ...], tuple[GoalOutput, ...]]:
        """The next states, and what each goal says about the control step."""
        keys = jax.random.split(key, len(self.goals) or 1)
        after, outputs = [], []
        seen = self._seen(kinematics)
        for goal, k, state, kin in zip(self.goals, keys, states, seen, strict=False):
            state, output = goal.step(k, state, kin)
            after.append(state)
            outputs.append(output)
        return tuple(after), tuple(outputs)

    def toward(
        self, states: tuple[Any, ...], kinematics: Kinematics, bearing: jax.Array
    ) -> tuple[Any, ...]:
        """The states with their targets at a bearing [B] (rad), where they have a direction."""
        seen = zip(self.goals, states, self._seen(kinematics), strict=True)
        return tuple(goal.toward(state, kin, bearing) for goal, state, kin in seen)

    def observe(self, states: tuple[Any, ...], kinematics: Kinematics) -> jax.Array:
        """All goal states g side by side [B, sum of G]."""
        parts = [
            goal.observe(state, seen)
            for goal, state, seen in zip(self.goals, states, self._seen(kinematics), strict=True)
        ]
        return jnp.concatenate(parts, axis=-1)

    def command(self, states: tuple[Any, ...], kinematics: Kinematics) -> PropCommand | None:
        """The commands of all goals' balls; None where there are no balls."""
        parts = [
            goal.command(state, seen)
            for goal, state, seen in zip(self.goals, states, self._seen(kinematics), strict=True)
        ]
        found = [part for part in parts if part is not None]
        if not found:
            return None
        return jax.tree.map(lambda *leaves: jnp.concatenate(leaves, axis=1), *found)

    def markers(self, states: tuple[Any, ...], kinematics: Kinematics) -> list[Marker]:
        """What to draw for one episode, given rows without the axis B: markers and all balls."""
        pairs = zip(self.goals, states, strict=True)
        found = [marker for goal, state in pairs for marker in goal.markers(state, kinematics)]
        places = np.zeros((0, 3)) if not self.balls else np.asarray(kinematics.prop_position)
        for ball, place in zip(self.balls, places, strict=True):
            found.append(Marker(position=place, radius=ball.radius_m, rgba=ball.rgba))
        return found

    def steer(
        self, states: tuple[Any, ...], orders: Mapping[str, tuple[dict[str, Any], float]]
    ) -> tuple[Any, ...]:
        """The states with the targets of some goals set: name -> its order, and its age (s)."""
        pairs = zip(self.goals, states, strict=True)
        return tuple(
            goal.steer(state, *orders[goal.name]) if goal.name in orders else state
            for goal, state in pairs
        )

    def check_numbers(self, kinematics: Kinematics) -> None:
        """Raise ConfigError where a user's goal says NaN or infinity of these states."""
        for goal, seen in zip(self.goals, self._seen(kinematics), strict=True):
            if isinstance(goal, CheckedGoal):
                goal.check_numbers(seen)

    def _seen(self, kinematics: Kinematics) -> list[Kinematics]:
        """What each goal sees: the character, and its own balls alone."""
        seen, first = [], 0
        for goal in self.goals:
            own = slice(first, first + len(goal.balls))
            first = own.stop
            seen.append(_with_balls(kinematics, own))
        return seen


def equipment_of(names: Collection[str]) -> Equipment:
    """What the character must be loaded with for the goals of a config, before they are made."""
    kinds = [_kind(name) for name in names]
    balls = tuple(ball for kind in kinds for ball in kind.balls)
    return Equipment(balls=balls, racket=any(getattr(kind, "racket", False) for kind in kinds))


def make_goals(
    settings: Mapping[str, Mapping[str, Any]], character: CharacterSpec, control_dt: float
) -> Goals:
    """The goals of a config section {name: {setting: value}}.

    Raises ConfigError that names the key and the choices.
    """
    made = tuple(_make(name, values, character, control_dt) for name, values in settings.items())
    return Goals(made)


def _kind(name: str) -> Any:
    """The class of a goal, which is checked where it is a user's."""
    kind = GOALS.choose(name, "composite.goals")
    if kind not in _OWN:
        check_kind(kind, name)
    return kind


def _make(
    name: str, values: Mapping[str, Any] | None, character: CharacterSpec, control_dt: float
) -> Any:
    key = f"composite.goals.{name}"
    goal = _kind(name)
    fields = {f.name: f for f in dataclasses.fields(goal) if f.default is not dataclasses.MISSING}
    given = {}
    for setting, value in (values or {}).items():
        check_name(setting, tuple(fields), key)
        given[setting] = _rising(value, fields[setting].default, f"{key}.{setting}")
    with from_outside(f"{key}: its settings"):
        check_values(goal, given, key)
    arguments: dict[str, Any] = given | _asked_for(goal, character, control_dt, key)
    if goal in _OWN:
        return goal(**arguments)
    with from_outside(f"{key}: its settings"):
        return CheckedGoal(goal(**arguments))


def _asked_for(goal: Any, character: CharacterSpec, control_dt: float, key: str) -> dict[str, Any]:
    """What a goal wants to know beside its settings: indices of links, and the control period."""
    wanted: Mapping[str, str] = getattr(goal, "links", {})
    for link in wanted.values():
        check_name(link, character.link_names, f"{key}: links")
    found: dict[str, Any] = {field: character.link(link) for field, link in wanted.items()}
    if any(field.name == "control_dt" for field in dataclasses.fields(goal)):
        found["control_dt"] = control_dt
    return found


def _rising(value: Any, default: Any, key: str) -> Any:
    """A number, or a tuple of as many numbers in rising order as the default has."""
    count = len(default) if isinstance(default, tuple) else 1
    numbers = list(value) if isinstance(value, list | tuple) else [value]
    numeric = all(isinstance(n, int | float) and not isinstance(n, bool) for n in numbers)
    if not numeric or len(numbers) != count or sorted(numbers) != numbers:
        expected = f"{count} rising numbers" if count > 1 else "a number"
        raise ConfigError(f"{key}: expected {expected} such as {default}, got {value!r}")
    return tuple(numbers) if count > 1 else numbers[0]


def _with_balls(kinematics: Kinematics, own: slice) -> Kinematics:
    position, velocity = kinematics.prop_position, kinematics.prop_velocity
    if position is None or velocity is None or own.start == own.stop:
        return kinematics.replace(prop_position=None, prop_velocity=None)
    return kinematics.replace(prop_position=position[:, own], prop_velocity=velocity[:, own])
