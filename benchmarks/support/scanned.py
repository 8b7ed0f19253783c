"""A rollout's commands to an engine that is JAX itself, and a scan over that engine alone."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from flax import struct

from getup_jax.core.types import Engine, PhysicsState, PropCommand, StepOutput, select


@struct.dataclass
class Command:
    """The arguments of one call of `Engine.step`."""

    state: PhysicsState  # [B] before it
    ctrl: jax.Array  # [B, J] rad
    balls: PropCommand | None  # [B, Q]; None: there are none
    wrench: jax.Array | None  # [B, 6] N, Nm of the helping hand; None: there is none


class RecordedEngine:
    """The engine, which also remembers the arguments of its step."""

    def __init__(self, engine: Engine) -> None:
        self._engine, self.commands = engine, []

    def __getattr__(self, name: str) -> Any:
        return getattr(self._engine, name)

    def step(
        self,
        state: PhysicsState,
        ctrl: jax.Array,
        balls: PropCommand | None = None,
        wrench: jax.Array | None = None,
    ) -> PhysicsState:
        self.commands.append(Command(state, ctrl, balls, wrench))
        return self._engine.step(state, ctrl, balls, wrench)


@dataclasses.dataclass(frozen=True)
class Recorded:
    """An environment whose extras are the commands to its engine."""

    env: Any
    recorder: RecordedEngine

    @property
    def engine(self) -> RecordedEngine:
        return self.recorder

    @property
    def action_size(self) -> int:
        return self.env.action_size

    @property
    def observation_size(self) -> int:
        return self.env.observation_size

    def step(self, world: Any, state: Any, action: jax.Array) -> tuple[Any, StepOutput]:
        self.recorder.commands.clear()
        after, output = self.env.step(world, state, action)
        (command,) = self.recorder.commands
        return after, output.replace(extras=command)


def recorded_of(env: Any) -> Recorded:
    """The environment with a recorded engine, which is that of the task below a meta policy."""
    if not hasattr(env, "task"):
        engine = RecordedEngine(env.engine)
        return Recorded(dataclasses.replace(env, engine=engine), engine)
    engine = RecordedEngine(env.task.engine)
    task = dataclasses.replace(env.task, engine=engine)
    return Recorded(dataclasses.replace(env, task=task), engine)


def scan_run(engine: Any, collected: Any, last: PhysicsState) -> Callable[[], Any]:
    """The engine alone with the commands of a recorded rollout, new starts included.

    last: the states that the rollout left.
    """
    samples, commands = collected.transition, collected.transition.extras
    later = jax.tree.map(lambda x, y: jnp.concatenate([x[1:], y[None]]), commands.state, last)

    def step(state: PhysicsState, inputs: tuple) -> tuple[PhysicsState, None]:
        command, ended, start = inputs
        state = engine.step(state, command.ctrl, command.balls, command.wrench)
        return select(ended, start, state), None

    def play(first: PhysicsState, inputs: tuple) -> PhysicsState:
        return jax.lax.scan(step, first, inputs)[0]

    first = jax.tree.map(lambda x: x[0], commands.state)
    compiled = jax.jit(play, compiler_options=engine.compiler_options)
    inputs = (commands, samples.terminated | samples.truncated, later)
    return lambda: jax.block_until_ready(compiled(first, inputs))
