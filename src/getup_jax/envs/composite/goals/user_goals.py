"""Goals that users registered: what is wrong with one is said in a line, before it trains."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any, NoReturn

import jax
import jax.numpy as jnp

from getup_jax.config import ConfigError
from getup_jax.config.check import shown
from getup_jax.config.from_outside import from_outside
from getup_jax.core.types import Kinematics, PropCommand
from getup_jax.envs.composite.goals.goal import Goal, GoalOutput, Marker
from getup_jax.physics.props import Ball

_OWN = ("reset", "step", "observe")  # functions that every goal has of its own
_OTHERS = ("toward", "command", "markers")
_HINT = "derive it from getup_jax.Goal, see docs/goals.md"


def check_kind(kind: Any, name: str | None = None) -> None:
    """Raise ConfigError unless a class can be a goal, called `name` where that is given."""
    known = (name, getattr(kind, "name", None), getattr(kind, "__name__", None), shown(kind))
    for problem in _problems(kind, name):
        raise ConfigError(f"goal {next(text for text in known if text)}: {problem}")


def _problems(kind: Any, name: str | None) -> Iterator[str]:
    if not isinstance(kind, type) or "__dataclass_fields__" not in vars(kind):
        yield f"expected a class with @dataclasses.dataclass(frozen=True), got {shown(kind)}"
    own = getattr(kind, "name", None)
    if not isinstance(own, str) or not own:
        yield f"name: expected the text that configs call it, got {shown(own)}"
    if name is not None and own != name:
        yield f"name: expected {name!r}, as its entry point is called, got {shown(own)}"
    size = getattr(kind, "observation_size", None)
    if not isinstance(size, int) or isinstance(size, bool) or size < 0:
        yield f"observation_size: expected how many numbers observe gives, got {shown(size)}"
    lacking = [word for word in (*_OWN, *_OTHERS) if not callable(getattr(kind, word, None))]
    lacking += [word for word in _OWN if getattr(kind, word, None) is getattr(Goal, word)]
    if lacking:
        yield f"has no {', '.join(lacking)}; {_HINT}"
    balls = getattr(kind, "balls", None)
    if not isinstance(balls, tuple) or not all(isinstance(ball, Ball) for ball in balls):
        yield f"balls: expected a tuple of getup_jax.physics.props.Ball, got {shown(balls)}"
    yield from _of_settings(kind)


def _of_settings(kind: Any) -> Iterator[str]:
    given = {"control_dt", *getattr(kind, "links", {})}
    for field in dataclasses.fields(kind):
        if field.default is not dataclasses.MISSING:
            if not _is_numbers(field.default):
                expected = "a number or a tuple of numbers as its default"
                yield f"{field.name}: expected {expected}, got {shown(field.default)}"
            continue
        made = not field.init or field.default_factory is not dataclasses.MISSING
        if not made and field.name not in given:
            yield f"{field.name}: expected a default; only control_dt and links have none"


def _is_numbers(value: Any) -> bool:
    items = value if isinstance(value, tuple) else (value,)
    kinds = {type(item) for item in items}
    return bool(kinds) and kinds <= {int, float}


@dataclasses.dataclass(frozen=True)
class CheckedGoal:
    """A user's goal, each of whose answers is checked as it is traced.

    Raises ConfigError that names the goal, the function, what was expected and what came.
    """

    goal: Any

    @property
    def name(self) -> str:
        """What configs call it."""
        return self.goal.name

    @property
    def observation_size(self) -> int:
        """G."""
        return self.goal.observation_size

    @property
    def balls(self) -> tuple[Ball, ...]:
        """That it plays with."""
        return self.goal.balls

    def reset(self, key: jax.Array, kinematics: Kinematics) -> Any:
        """As `Goal.reset`."""
        state = self._ask("reset", key, kinematics)
        count = len(kinematics.finite)
        for path, leaf in jax.tree_util.tree_leaves_with_path(state):
            shape = jnp.shape(leaf)
            if shape[:1] != (count,):
                where = f"reset: state{jax.tree_util.keystr(path)}"
                self._fail(where, f"shape ({count}, ...), a row for each simulation", shape)
        return jax.tree.map(jnp.asarray, state)

    def step(self, key: jax.Array, state: Any, kinematics: Kinematics) -> tuple[Any, GoalOutput]:
        """As `Goal.step`; the reward is NaN where the goal's observation is not finite.

        So a run that this breaks ends with the goal's name, not with that of a loss.
        """
        answer = self._ask("step", key, state, kinematics)
        if not isinstance(answer, tuple) or len(answer) != 2:
            self._fail("step", "a pair of a state and a GoalOutput", _kind(answer))
        after, output = answer
        if not isinstance(output, GoalOutput):
            self._fail("step", "a GoalOutput beside the state", _kind(output))
        self._like("step", state, after)
        for name, value in vars(output).items():
            self._shaped(f"step: {name}", value, kinematics.finite.shape)
        terminated = jnp.asarray(output.terminated)
        if terminated.dtype != bool:
            self._fail("step: terminated", "bool", terminated.dtype)
        seen = jnp.isfinite(self.observe(after, kinematics)).all(axis=-1)
        return after, GoalOutput(
            reward=jnp.where(seen, jnp.asarray(output.reward, jnp.float32), jnp.nan),
            terminated=terminated,
            success=jnp.asarray(output.success, jnp.float32),
        )

    def toward(self, state: Any, kinematics: Kinematics, bearing: jax.Array) -> Any:
        """As `Goal.toward`."""
        return self._like("toward", state, self._ask("toward", state, kinematics, bearing))

    def observe(self, state: Any, kinematics: Kinematics) -> jax.Array:
        """As `Goal.observe`."""
        seen = self._ask("observe", state, kinematics)
        self._shaped("observe", seen, (len(kinematics.finite), self.observation_size))
        return jnp.asarray(seen, jnp.float32)

    def command(self, state: Any, kinematics: Kinematics) -> PropCommand | None:
        """As `Goal.command`."""
        command = self._ask("command", state, kinematics)
        if command is None and not self.balls:
            return None
        if not isinstance(command, PropCommand):
            self._fail("command", "a PropCommand, for its balls", _kind(command))
        rows = (len(kinematics.finite), len(self.balls))
        self._shaped("command: mask", command.mask, rows)
        self._shaped("command: position", command.position, (*rows, 3))
        self._shaped("command: velocity", command.velocity, (*rows, 3))
        return command

    def markers(self, state: Any, kinematics: Kinematics) -> list[Marker]:
        """As `Goal.markers`."""
        return self._ask("markers", state, kinematics)

    def steer(self, state: Any, order: dict[str, Any], age_s: float) -> Any:
        """As `Goal.steer`."""
        return self._like("steer", state, self._ask("steer", state, order, age_s))

    def check_numbers(self, kinematics: Kinematics) -> None:
        """Raise ConfigError where what it says of these states, and a step later, is no number."""

        def numbers(kinematics: Kinematics) -> tuple[jax.Array, jax.Array]:
            key = jax.random.PRNGKey(0)
            state = self.reset(key, kinematics)
            observation = self.observe(state, kinematics)
            return observation, self.step(key, state, kinematics)[1].reward

        observation, reward = jax.jit(numbers)(kinematics)
        for name, values in (("observe", observation), ("step: reward", reward)):
            good = jnp.isfinite(values).reshape(len(values), -1).all(axis=-1)
            bad = int((kinematics.finite & ~good).sum())
            if bad:
                start = f"NaN or infinity in {bad} of {len(values)} start states"
                self._fail(name, "finite numbers", start)

    def _ask(self, function: str, *arguments: Any) -> Any:
        with from_outside(f"composite.goals.{self.name}: {function}"):
            return getattr(self.goal, function)(*arguments)

    def _like(self, place: str, before: Any, after: Any) -> Any:
        one, other = _layout(before), _layout(after)
        if one != other:
            self._fail(place, f"a state like the one before, {shown(one)}", shown(other))
        return after

    def _shaped(self, place: str, value: Any, shape: tuple[int, ...]) -> None:
        if jnp.shape(value) != shape:
            self._fail(place, f"shape {shape}", jnp.shape(value))

    def _fail(self, place: str, expected: str, got: Any) -> NoReturn:
        raise ConfigError(f"composite.goals.{self.name}: {place}: expected {expected}, got {got}")


def _kind(value: Any) -> str:
    return type(value).__name__


def _layout(state: Any) -> dict[str, str]:
    """Shape and type of every leaf, by its place."""
    leaves = jax.tree_util.tree_leaves_with_path(state)
    return {
        jax.tree_util.keystr(path): f"{jnp.asarray(x).dtype}{list(jnp.shape(x))}"
        for path, x in leaves
    }
