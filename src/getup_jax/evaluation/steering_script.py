"""Command files for `getup-eval --script`: what one character is told, and when.

duration_s: 20
commands:
  - {at_s: 0, target_location: {place: [3, 0], within_s: 3}}
  - {at_s: 6, policy: runs/crouch, target_location: {place: [3, 3]}}
  - {at_s: 12, aiming: {yaw_deg: 90}}
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from getup_jax.config import ConfigError, yaml_text
from getup_jax.config.check import shown
from getup_jax.config.ranges import Range, check
from getup_jax.config.registry import check_name
from getup_jax.envs.composite.goals.combine import GOALS
from getup_jax.envs.composite.goals.goal import REQUIRED

_MOST = 1e6  # s, m, degrees
_FORM = "a file with duration_s and a list of commands, see docs/composite.md"


@dataclasses.dataclass(frozen=True)
class Command:
    """From `at_s` on: another policy, and targets of goals."""

    at_s: float
    policy: str | None  # None: as before
    targets: dict[str, dict[str, Any]]  # goal -> its order, every entry given

    @property
    def text(self) -> str:
        """The command in a line."""
        parts = [] if self.policy is None else [f"policy {self.policy}"]
        for goal, order in self.targets.items():
            said = ", ".join(f"{key} {value}" for key, value in order.items() if value is not None)
            parts.append(f"{goal}: {said}")
        return "; ".join(parts)


@dataclasses.dataclass(frozen=True)
class Script:
    """A whole file."""

    duration_s: float
    commands: tuple[Command, ...]  # in the order of their times


def read_script(path: Path) -> Script:
    """Read a command file; ConfigError names the place and what was expected."""
    content = yaml_text.read(path)
    if not isinstance(content, Mapping) or not isinstance(content.get("commands"), list):
        raise ConfigError(f"{path}: expected {_FORM}")
    for key in content:
        check_name(str(key), ("duration_s", "commands"), str(path))
    duration_s = _number(content.get("duration_s"), f"{path}: duration_s", least=0.1)
    commands = [
        _command(found, f"{path}: commands[{number}]", duration_s)
        for number, found in enumerate(content["commands"])
    ]
    if not commands:
        raise ConfigError(f"{path}: commands: expected at least one, got none")
    return Script(duration_s, tuple(sorted(commands, key=lambda command: command.at_s)))


def _command(found: Any, where: str, duration_s: float) -> Command:
    if not isinstance(found, Mapping):
        raise ConfigError(
            f"{where}: expected {{at_s: ..., policy or a goal: ...}}, got {shown(found)}"
        )
    for key in found:
        check_name(str(key), ("at_s", "policy", *GOALS), where)
    at_s = _number(found.get("at_s"), f"{where}.at_s", least=0.0)
    if at_s >= duration_s:
        raise ConfigError(f"{where}.at_s: expected less than duration_s {duration_s}, got {at_s}")
    policy = found.get("policy")
    if policy is not None and not isinstance(policy, str):
        raise ConfigError(
            f"{where}.policy: expected a run folder or a checkpoint, got {shown(policy)}"
        )
    targets = {
        name: read_order(name, found[name], f"{where}.{name}") for name in GOALS if name in found
    }
    if policy is None and not targets:
        raise ConfigError(f"{where}: expected a policy or one of {', '.join(GOALS)}")
    return Command(at_s, policy, targets)


def read_order(goal: str, found: Any, where: str) -> dict[str, Any]:
    """The numbers that a goal's `steer` reads, with its defaults for those not given.

    Raises ConfigError that names the place, what was expected and what came.
    """
    known: Mapping[str, tuple[int, Any]] = getattr(GOALS[goal], "orders", {})
    if not known:
        raise ConfigError(f"{where}: cannot be steered; leave it out")
    if not isinstance(found, Mapping):
        raise ConfigError(f"{where}: expected {{{', '.join(known)}}}, got {shown(found)}")
    for key in found:
        check_name(str(key), tuple(known), where)
    order = {}
    for key, (count, default) in known.items():
        if key in found:
            order[key] = _numbers(found[key], count, f"{where}.{key}")
        elif default is REQUIRED:
            raise ConfigError(f"{where}.{key}: missing; expected {_words(count)}")
        else:
            order[key] = default
    return order


def _numbers(value: Any, count: int, where: str) -> Any:
    if count == 1:
        return _number(value, where)
    if not isinstance(value, list) or len(value) != count:
        raise ConfigError(f"{where}: expected {_words(count)}, got {shown(value)}")
    return tuple(_number(item, where) for item in value)


def _words(count: int) -> str:
    return "a number" if count == 1 else f"a list of {count} numbers"


def _number(value: Any, where: str, least: float = -_MOST) -> float:
    check(value, float, Range(least=least, most=_MOST), where)
    return float(value)
