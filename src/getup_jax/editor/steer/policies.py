"""The policies that one character may be steered with; checked before anything is compiled."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from getup_jax.config import Config, ConfigError, PhysicsConfig
from getup_jax.editor.steer.character import Character
from getup_jax.editor.steer.recovery import GetUp
from getup_jax.envs.composite.goals.combine import GOALS, equipment_of
from getup_jax.evaluation.composite import evaluation_config
from getup_jax.evaluation.scenario import Scenario
from getup_jax.evaluation.steering import Player, check_alike, check_physics, player_of
from getup_jax.physics.character import load_character
from getup_jax.runtime.checkpoint import LoadedPolicy, load_policy, shipped_policies
from getup_jax.training.run import Log

_POOL = 64  # start states; a training wants many, a character begins now and then


@dataclasses.dataclass(frozen=True, eq=False)
class Offer:
    """A policy that fits the character."""

    name: str  # as it was asked for
    loaded: LoadedPolicy

    @property
    def goals(self) -> Mapping[str, Any]:
        """Settings that its config gives to its goals, by name."""
        composite = self.loaded.config.composite
        return {} if composite is None else composite.goals

    def describe(self) -> dict[str, Any]:
        """What the page must know: its goals, their settings, and the numbers of an order."""
        goals = {}
        for name, given in self.goals.items():
            kind = GOALS[name]
            defaults = {f.name: f.default for f in dataclasses.fields(kind)}
            numbers = {k: v for k, v in defaults.items() if v is not dataclasses.MISSING}
            orders = {key: count for key, (count, _) in getattr(kind, "orders", {}).items()}
            goals[name] = {**numbers, **(given or {}), "orders": orders}
        return {"name": self.name, "goals": goals, "steps": self.loaded.metadata.get("steps", 0)}


@dataclasses.dataclass(eq=False)
class Policies:
    """What is offered, in its order, and what of it is compiled."""

    offers: dict[str, Offer]  # the first one begins
    asked: tuple[str, ...]  # compiled at the start
    getup: LoadedPolicy | None = None
    players: dict[str, Player] = dataclasses.field(default_factory=dict)
    rising: GetUp | None = None  # the get-up policy, compiled

    @property
    def first(self) -> str:
        """The name of the policy that begins."""
        return next(iter(self.offers))

    @property
    def config(self) -> Config:
        """That of the policy that begins."""
        return self.offers[self.first].loaded.config

    def build(self, log: Log) -> None:
        """Compile those that were asked for, and the one that gets up."""
        if self.getup is not None:
            self.rising = GetUp.build(self.getup, log)
        for name in self.asked:
            self.load(name, log)

    def load(self, name: str, log: Log) -> None:
        """Compile one more of the offers."""
        if name in self.players:
            return
        loaded = self.offers[name].loaded
        player = player_of(loaded, _live(loaded.config), log)
        log(f"compiling {name} ...")
        Character({name: player}, self.rising, seed=0).compile()
        self.players[name] = player

    def describe(self) -> list[dict[str, Any]]:
        """All offers, for the page."""
        return [
            {**offer.describe(), "ready": name in self.players}
            for name, offer in self.offers.items()
        ]


def choose(first: str, loaded: LoadedPolicy, others: Sequence[str], getup: str | None) -> Policies:
    """The policy that begins, those that were named, and the shipped ones that fit.

    Raises CheckpointError and ConfigError, one line each, where one does not fit.
    """
    config = loaded.config
    offers = {first: Offer(first, loaded)}
    for name in others:
        other = load_policy(name)
        check_alike(other, config, f"--with {name}")
        if other.path not in {offer.loaded.path for offer in offers.values()}:
            offers[name] = Offer(name, other)
    asked = tuple(offers)
    rising = None if getup is None else load_policy(getup)
    if rising is not None:
        _check_getup(rising, config, f"--getup {getup}")
    for name in shipped_policies():
        other = load_policy(name)
        if rising is None and _fits(lambda other=other: _check_getup(other, config, "")):
            rising = other
        known = {offer.loaded.path for offer in offers.values()}
        if other.path not in known and _fits(lambda other=other: check_alike(other, config, "")):
            offers[name] = Offer(name, other)
    return Policies(offers, asked, rising)


def _check_getup(other: LoadedPolicy, config: Config, where: str) -> None:
    """Raise ConfigError unless the policy gets the character up, on flat ground."""
    if other.config.composite_motion:
        raise ConfigError(f"{where}: is of composite motion; expected a policy that gets up")
    if other.config.terrain is not None:
        raise ConfigError(f"{where}: was trained on irregular ground; expected one of flat ground")
    assert config.composite is not None
    physics = other.config.physics
    if same_hinges(physics, config.physics):  # also under other names
        physics = dataclasses.replace(physics, character=config.physics.character)
    check_physics(dataclasses.replace(other.config, physics=physics), config, where)
    if equipment_of(config.composite.goals) != equipment_of(()):
        raise ConfigError(
            f"{where}: gets up with empty hands, but the first policy plays with balls or a "
            "racket; leave it out"
        )


def same_hinges(one: PhysicsConfig, two: PhysicsConfig) -> bool:
    """Whether two characters are one body, perhaps under other names: what moves one moves both."""
    if one.character == two.character:
        return True
    a, b = load_character(one), load_character(two)
    if a.num_joints != b.num_joints or not math.isclose(a.weight, b.weight, rel_tol=1e-3):
        return False
    fields = ("neutral_qpos", "joint_lower", "joint_upper", "torque_limit")
    return all(np.allclose(getattr(a, f), getattr(b, f), atol=1e-4) for f in fields)


def _fits(check: Any) -> bool:
    try:
        check()
    except ConfigError:
        return False
    return True


def _live(config: Config) -> Config:
    """The config of an evaluation, with few start states and nothing to regress on."""
    config = evaluation_config(config, Scenario())
    assert config.composite is not None
    return dataclasses.replace(
        config,
        task=dataclasses.replace(config.task, pool_size=_POOL),
        composite=dataclasses.replace(config.composite, warm_start=False),
    )
