"""The engine alone, given what a rollout gave it, so that both do one work."""

from __future__ import annotations

import contextlib
import dataclasses
import os
from collections.abc import Callable, Iterator
from typing import Any

import jax
import mujoco
import numpy as np
from mujoco.batch import Batch, SimulationError

from getup_jax.config import PhysicsConfig
from support.scanned import recorded_of, scan_run

Run = Callable[[], Any]


class ReplayError(ValueError):
    """The engine alone came to other states than the rollout: their rates do not compare."""


@dataclasses.dataclass(frozen=True, eq=False)
class Script:
    """T control steps of B simulations, as the native engine was asked for them."""

    rows: np.ndarray  # [T + 1, B, nstate] float64, states before every step, and the last ones
    ctrl: np.ndarray  # [T, B, J] rad
    balls: tuple[np.ndarray, ...]  # mask [T, B, Q], position and velocity [T, B, Q, 3]; () without
    wrench: np.ndarray | None  # [T, B, 6] N, Nm of the helping hand; None: there is none
    ended: np.ndarray  # [T, B] bool, episodes that a step ended: the next state is a new start


def raw_run(learner: Any, physics: PhysicsConfig, world: Any, state: Any) -> Run:
    """The engine alone with all that the rollout of an iteration from `state` gives it.

    Raises ReplayError where a native engine comes to other states than the rollout.
    """
    engine = engine_of(learner.env)
    if engine.name != "native":
        recording = dataclasses.replace(learner, env=recorded_of(learner.env))
        collect = jax.jit(recording.collect, compiler_options=engine.compiler_options)
        collected = collect(world, state)
        return scan_run(engine, collected, below(collected.environment).physics)
    # a new function is compiled anew, and so calls what listens
    script = make_script(
        engine,
        learner.config.num_envs,
        lambda: jax.jit(lambda world, state: learner.collect(world, state))(world, state),
    )
    return BatchLoop(engine.model, physics, script).checked()


def make_script(engine: Any, size: int, collect: Callable[[], Any]) -> Script:
    """What a rollout, compiled only now, asks of the native engine."""
    with _heard(engine._batch(size)) as calls:
        collected = collect()
        last = np.asarray(below(collected.environment).physics.engine)
    rows, ctrl, *more = (np.stack(part) for part in zip(*calls, strict=True))
    balls, wrench = more[: len(more) // 3 * 3], more[len(more) // 3 * 3 :]
    ended = collected.transition.terminated | collected.transition.truncated
    return Script(
        rows=np.concatenate([rows, last[None]]).view(np.float64),
        ctrl=np.nan_to_num(ctrl),
        balls=tuple(balls),
        wrench=np.nan_to_num(wrench[0]) if wrench else None,
        ended=np.asarray(ended),
    )


@contextlib.contextmanager
def _heard(host: Any) -> Iterator[list[tuple[np.ndarray, ...]]]:
    """The arguments of the engine's host function, call by call.

    Not those of `Engine.step` inside jit: what is compiled twice, for the engine and for a record
    of it, may be rounded twice.
    """
    calls: list[tuple[np.ndarray, ...]] = []
    step = host.step

    def listen(context: Any, out: Any, *arguments: Any) -> None:
        calls.append(tuple(np.asarray(x).copy() for x in arguments))
        step(context, out, *arguments)

    host.step = listen
    try:
        yield calls
    finally:
        del host.step


class BatchLoop:
    """A plain loop over `mujoco.batch.Batch`, without JAX."""

    def __init__(self, model: mujoco.MjModel, physics: PhysicsConfig, script: Script) -> None:
        self._script = script
        self._ended = [np.flatnonzero(ended) for ended in script.ended]
        size, threads = script.rows.shape[1], physics.threads or len(os.sched_getaffinity(0))
        self._batch = Batch(model, size, min(threads, size), persistent=True)
        self._forces = self._batch.bind("xfrc_applied")
        self._step = {"nstep": physics.substeps, "stage": mujoco.mjtStage.mjSTAGE_VEL.value}

    def run(self) -> None:
        """From the script's first states to its last."""
        self._batch.state[...] = self._script.rows[0]
        for number in range(len(self._ended)):
            self._advance(number)

    def checked(self) -> Run:
        """`run`, once every step has been seen to give the rollout's states, bit for bit."""
        self._batch.state[...] = self._script.rows[0]
        for number, after in enumerate(self._script.rows[1:]):
            self._advance(number)
            if not np.array_equal(self._batch.state, after, equal_nan=True):
                raise ReplayError(
                    f"raw and rollout differ after step {number + 1}: their rates do not compare"
                )
        return self.run

    def _advance(self, number: int) -> None:
        """One control step; the episodes that it ends start anew."""
        script, batch = self._script, self._batch
        if script.wrench is not None:
            self._forces[:, 1] = script.wrench[number]
        if script.balls:
            self._put_balls(*(part[number] for part in script.balls))
        batch.ctrl = script.ctrl[number]
        with contextlib.suppress(SimulationError):
            batch.step(**self._step)
        if script.wrench is not None:
            self._forces[:, 1] = 0.0
        ended = self._ended[number]
        batch.state[ended] = script.rows[number + 1][ended]

    def _put_balls(self, mask: np.ndarray, position: np.ndarray, velocity: np.ndarray) -> None:
        """Balls are the last free bodies of the model."""
        count = mask.shape[1]
        qpos = self._batch.bind("qpos")[:, -7 * count :].reshape(-1, count, 7)
        qvel = self._batch.bind("qvel")[:, -6 * count :].reshape(-1, count, 6)
        qpos[mask, :3] = position[mask]
        qvel[mask, :3], qvel[mask, 3:] = velocity[mask], 0.0
        self._batch.bind("qpos")[:, -7 * count :] = qpos.reshape(len(mask), -1)
        self._batch.bind("qvel")[:, -6 * count :] = qvel.reshape(len(mask), -1)


def engine_of(env: Any) -> Any:
    """Of a task, or of the task below a meta policy."""
    return below(env).engine


def below(task_or_state: Any) -> Any:
    """The task (or its state) below a meta policy."""
    return getattr(task_or_state, "task", task_or_state)
