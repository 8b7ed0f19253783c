"""Policies from outside this package: an ONNX file, or a function or class in Python.

They see the state of B characters by name, see `seen`, and give servo targets [B, J] (rad). What
the episodes are made of has no pose prior and no filter then, so that an action is a target.
"""

from __future__ import annotations

import dataclasses
import importlib
import os
import sys
import sysconfig
import traceback
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from getup_jax.config import Config, ConfigError
from getup_jax.envs.getup.episode import EpisodeState
from getup_jax.envs.getup.task import GetUpTask
from getup_jax.runtime.extras import load_extra

Seen = Mapping[str, np.ndarray]
Act = Callable[[Seen], Any]  # state to servo targets [B, J]
NAMES = ("qpos", "qvel", "ground", "points", "duration", "time", "target")


@dataclasses.dataclass(frozen=True, eq=False)
class OutsidePolicy:
    """A policy of which only what it does is known."""

    name: str  # as the user gave it
    make: Callable[[], Act]  # for one batch of episodes, so that it may have a memory

    def begun(self) -> Acting:
        """It at the start of a batch of episodes.

        What it then raises, or gives in another shape, is a ConfigError of one line.
        """
        act = self._guarded(self.make)
        return Acting(lambda state: self._checked(self._guarded(lambda: act(state)), state))

    def _guarded(self, call: Callable[[], Any]) -> Any:
        try:
            return call()
        except (Exception, SystemExit) as error:
            raise ConfigError(f"{self.name}: failed: {_said(error)}") from error

    def _checked(self, target: Any, state: Seen) -> np.ndarray:
        found = self._guarded(lambda: np.asarray(target, np.float32))
        if found.shape != state["target"].shape:
            raise ConfigError(
                f"{self.name}: expected servo targets of shape {state['target'].shape}, "
                f"got {found.shape}"
            )
        if not np.isfinite(found).all():
            raise ConfigError(f"{self.name}: expected finite servo targets, got NaN or infinity")
        return found


@dataclasses.dataclass(eq=False)
class Acting:
    """A policy in a batch of episodes, and what it is told next.

    As an observation of ours, that is the state that the last step led to: of a push, a policy
    knows a step later.
    """

    act: Act
    state: Seen | None = None  # None: the episodes begin


def as_outside(config: Config) -> Config:
    """The config of a task whose actions are servo targets, beside the neutral pose."""
    task = dataclasses.replace(config.task, filter=1.0, offset_scale=1.0)
    return dataclasses.replace(config, task=task, prior=None)


def seen(env: GetUpTask, world: Any, state: EpisodeState) -> dict[str, jax.Array]:
    """What a policy from outside is told, in the names of docs/onnx.md, and `target` [B, J].

    `target` is the servo target that holds now.
    """
    kinematics = state.physics.kinematics
    posture = env.observer.posture(kinematics, world.terrain)
    values = (
        kinematics.qpos,
        kinematics.qvel,
        kinematics.qpos[:, 2:3] - posture.height_map,
        state.points,
        state.duration,
        state.time,
        env.servo_target(world, state, state.action),
    )
    return dict(zip(NAMES, values, strict=True))


def to_action(env: GetUpTask, target: np.ndarray) -> jax.Array:
    """The actions [B, J] whose servo targets these are [B, J] (rad); see `as_outside`."""
    return jnp.asarray(target - env.character.neutral_qpos[7:], jnp.float32)


def is_outside(name: str) -> bool:
    """Whether it names an ONNX file or `module:function`, and no checkpoint of this package."""
    module, colon, attribute = name.partition(":")
    parts = module.split(".")
    return name.endswith(".onnx") or (
        bool(colon) and attribute.isidentifier() and all(part.isidentifier() for part in parts)
    )


def load_outside(name: str) -> OutsidePolicy:
    """The policy of an ONNX file or of `module:function`; ConfigError says what is wrong."""
    if name.endswith(".onnx"):
        return OutsidePolicy(name, _onnx(Path(name)))
    return OutsidePolicy(name, _python(name))


def _python(name: str) -> Callable[[], Act]:
    """A class makes a policy for each batch; a function is one."""
    module_name, _, attribute = name.partition(":")
    if os.getcwd() not in sys.path:
        sys.path.insert(0, os.getcwd())  # as for `python -m`
    try:
        module = importlib.import_module(module_name)
    except (Exception, SystemExit) as error:
        hint = "; leave .py off" if module_name.endswith(".py") else ""
        raise ConfigError(f"{name}: cannot be imported: {_said(error)}{hint}") from None
    found = getattr(module, attribute, None)
    if not callable(found):
        raise ConfigError(f"{name}: expected a function or class {attribute!r} in {module_name}")
    return found if isinstance(found, type) else lambda: found


def _said(error: BaseException) -> str:
    """What was raised in one line, and where in the user's own files."""
    text = f"{type(error).__name__}: {' '.join(str(error).split())}"
    frames = [x for x in traceback.extract_tb(error.__traceback__) if _is_the_users(x.filename)]
    return (
        f"{text} ({Path(frames[-1].filename).name}, line {frames[-1].lineno})" if frames else text
    )


def _is_the_users(file: str) -> bool:
    """Neither of this package, nor of Python and what is installed in it."""
    installed = {Path(sysconfig.get_path(name)) for name in ("stdlib", "purelib", "platlib")}
    not_theirs = {Path(__file__).parents[1], *installed}
    return not file.startswith("<") and not_theirs.isdisjoint(Path(file).parents)


def _onnx(file: Path) -> Callable[[], Act]:
    """What getup-export wrote, with its other graphs beside it; or one graph of `NAMES`."""
    runtime = load_extra("onnxruntime", "onnx", str(file))
    parts = [file.with_name(f"{file.stem}{part}.onnx") for part in ("", "_observation", "_start")]
    whole = all(part.is_file() for part in parts[1:])
    options = runtime.SessionOptions()
    options.intra_op_num_threads = 1
    sessions = []
    for part in parts if whole else parts[:1]:
        if not part.is_file():
            raise ConfigError(f"{part}: no such file")
        try:
            session = runtime.InferenceSession(
                part.read_bytes(), options, providers=["CPUExecutionProvider"]
            )
        except Exception as error:
            reason = " ".join(str(error).split())[:200]
            raise ConfigError(f"{part}: not an ONNX file: {reason}") from None
        sessions.append(session)
    if whole:
        return lambda: _Exported(*sessions)
    unknown = [x.name for x in sessions[0].get_inputs() if x.name not in NAMES]
    if unknown:
        raise ConfigError(
            f"{file}: inputs {', '.join(unknown)}: expected some of {', '.join(NAMES)}; or "
            f"{parts[1].name} and {parts[2].name} beside it, as getup-export writes them"
        )
    return lambda: lambda state: _run(sessions[0], state)[0]


class _Exported:
    """The three graphs of getup-export, and the action that their filter holds."""

    def __init__(self, policy: Any, observation: Any, start: Any) -> None:
        self._policy, self._observation, self._start = policy, observation, start
        self._action: np.ndarray | None = None

    def __call__(self, state: Seen) -> np.ndarray:
        if self._action is None:
            (self._action,) = _run(self._start, state)
        (observation,) = _run(self._observation, {**state, "action": self._action})
        target, self._action = _run(self._policy, {"observation": observation})
        return target


def _run(session: Any, values: Seen) -> list[np.ndarray]:
    """The results [B, ...] of a graph; one call a character where its leading axis is 1."""
    inputs = session.get_inputs()
    if not inputs:
        raise ValueError(f"a graph without inputs, expected some of {', '.join(NAMES)}")
    given = {x.name: np.asarray(values[x.name], np.float32) for x in inputs}
    if any(x.shape[0] != 1 for x in inputs):
        return session.run(None, given)
    rows = range(len(next(iter(given.values()))))
    found = [session.run(None, {name: x[i : i + 1] for name, x in given.items()}) for i in rows]
    return [np.concatenate(parts) for parts in zip(*found, strict=True)]
