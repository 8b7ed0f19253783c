"""The native engine: `mujoco.batch.Batch` on a thread pool, called inside jit.

A simulation's whole state is its float64 integration-state row. JAX carries the rows as
uint32[B, 2 * nstate], bit for bit, so that a step is a pure function of its arguments: no
ordering tokens, exact checkpoints, and a reset is a `where` on rows.

The host function never touches jax: a jitted call inside a callback hangs for large batches.
"""

from __future__ import annotations

import copy
import threading
from typing import Any, cast

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from jax.experimental.buffer_callback import buffer_callback
from mujoco.batch import Batch, SimulationError

from getup_jax.config import PhysicsConfig
from getup_jax.core.cpus import cpus
from getup_jax.core.types import Kinematics, PhysicsState, PropCommand, check_control
from getup_jax.physics.character import CharacterSpec
from getup_jax.physics.props import with_balls

_STAGE = mujoco.mjtStage.mjSTAGE_VEL.value
_FAST_LIMIT = 1e4  # rad/s or m/s; a state past it has diverged


class _Sizes:
    """How much of the model's state is the character's; balls come behind it."""

    def __init__(self, character: CharacterSpec):
        self.links, self.joints = len(character.link_names), character.num_joints
        self.balls = len(character.ball_names)
        self.qpos, self.qvel = 7 + self.joints, 6 + self.joints

    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Of the Kinematics' fields, without the axis B and the finite flag."""
        vector = (self.links, 3)
        shapes: dict[str, tuple[int, ...]] = {
            "qpos": (self.qpos,),
            "qvel": (self.qvel,),
            "link_position": vector,
            "link_quaternion": (self.links, 4),
            "link_angular_velocity": vector,
            "link_linear_velocity": vector,
            "torque": (self.joints,),
        }
        if self.balls:
            shapes |= {"prop_position": (self.balls, 3), "prop_velocity": (self.balls, 3)}
        return shapes


PLACE_CHUNK = 256  # states that `place` makes at once: MuJoCo keeps half a MB for each


class NativeEngine:
    """Steps batches of one character with MuJoCo's own batch stepper, in float64."""

    name = "native"
    compiler_options: dict[str, Any] | None = None

    def __init__(self, character: CharacterSpec, config: PhysicsConfig):
        self.model = _without_autoreset(character.scene)
        self._sizes = _Sizes(character)
        self.control_dt = 1.0 / config.control_hz
        self._substeps = config.substeps
        self._threads = config.threads or cpus()
        self._batches: dict[int, _HostBatch] = {}
        self._lock = threading.Lock()

    def place(self, qpos: Any, qvel: Any) -> PhysicsState:
        """See `Engine.place`; runs on the host, some states at a time."""
        qpos, qvel = np.asarray(qpos, np.float64), np.asarray(qvel, np.float64)
        qpos, qvel = with_balls(qpos, qvel, self.model)
        size = min(len(qpos), PLACE_CHUNK)
        batch, parts = _HostBatch(self, size), []
        for first in range(0, len(qpos), size):
            # the last one is filled up, so that one batch serves all of them
            index = np.minimum(np.arange(first, first + size), len(qpos) - 1)
            placed, keep = batch.place(qpos[index], qvel[index]), len(qpos) - first
            parts.append(jax.tree.map(lambda x, keep=keep: x[:keep], placed))
        return jax.device_put(jax.tree.map(lambda *x: np.concatenate(x), *parts))

    def step(
        self,
        state: PhysicsState,
        ctrl: jax.Array,
        balls: PropCommand | None = None,
        wrench: jax.Array | None = None,
    ) -> PhysicsState:
        """See `Engine.step`."""
        check_control(state, ctrl, wrench)
        batch = self._batch(ctrl.shape[0])
        call = buffer_callback(batch.step, batch.result_shapes, vmap_method=None)
        command = () if balls is None else (balls.mask, balls.position, balls.velocity)
        if wrench is not None:
            command += (wrench,)
        rows, kinematics = call(state.engine, ctrl.astype(jnp.float32), *command)
        return PhysicsState(engine=rows, kinematics=Kinematics(**kinematics))

    def _batch(self, size: int) -> _HostBatch:
        # one set of MjData per batch size, made when it is first asked for
        with self._lock:
            if size not in self._batches:
                self._batches[size] = _HostBatch(self, size)
            return self._batches[size]


class _HostBatch:
    """The host side of one batch size: NumPy only."""

    def __init__(self, engine: NativeEngine, size: int):
        # persistent: the stage at the end of a step is not computed again by the next one
        # devices of one process step the same batch in turn, each with all threads
        self._turn = threading.Lock()
        self._batch = Batch(engine.model, size, min(engine._threads, size), persistent=True)
        self._substeps = engine._substeps
        self._sizes = engine._sizes
        state, derived = ("qpos", "qvel", "ctrl", "xfrc_applied"), ("xpos", "xquat", "cvel")
        fields = (*state, *derived, "subtree_com", "actuator_force")
        self._views = {name: self._batch.bind(name) for name in fields}
        shapes = self._sizes.shapes()
        kinematics = {k: jax.ShapeDtypeStruct((size, *s), np.float32) for k, s in shapes.items()}
        kinematics["finite"] = jax.ShapeDtypeStruct((size,), np.bool_)
        rows = jax.ShapeDtypeStruct((size, 2 * self._batch.nstate), np.uint32)
        self.result_shapes = (rows, kinematics)

    def step(self, _: Any, out: Any, rows: Any, ctrl: Any, *more: Any) -> None:
        """One control period, from rows and ctrl into the output buffers.

        more: the three parts of a command of balls, if any, then the wrench, if any.
        """
        with self._turn:
            self._step(out, rows, ctrl, *more)

    def _step(self, out: Any, rows: Any, ctrl: Any, *more: Any) -> None:
        self._batch.state[...] = np.asarray(rows).view(np.float64)
        balls, wrench = more[: len(more) // 3 * 3], more[len(more) // 3 * 3 :]
        if balls:
            self._put_balls(*(np.asarray(part) for part in balls))
        for force in wrench:
            self._views["xfrc_applied"][:, 1] = np.nan_to_num(np.asarray(force))
        self._views["ctrl"][...] = np.nan_to_num(np.asarray(ctrl))
        failed = np.zeros(self._batch.nsim, bool)
        try:
            self._batch.step(nstep=self._substeps, stage=_STAGE)
        except SimulationError as error:
            failed[error.ids] = True
        if wrench:
            self._views["xfrc_applied"][:, 1] = 0.0  # the next step may have none
        out_rows, out_kinematics = out
        np.asarray(out_rows)[...] = self._batch.state.view(np.uint32)
        self._write(failed, {name: np.asarray(buffer) for name, buffer in out_kinematics.items()})

    def place(self, qpos: np.ndarray, qvel: np.ndarray) -> PhysicsState:
        """Rows and kinematics at the given positions and velocities, ctrl = hinge angles."""
        self._batch.reset(stage=mujoco.mjtStage.mjSTAGE_NONE.value)
        self._views["qpos"][...], self._views["qvel"][...] = qpos, qvel
        self._views["ctrl"][...] = qpos[:, 7 : self._sizes.qpos]
        self._batch.forward()
        rows = self._batch.state.view(np.uint32).copy()
        out = {k: np.empty(s.shape, s.dtype) for k, s in self.result_shapes[1].items()}
        self._write(np.zeros(len(qpos), bool), out)
        kinematics: Any = Kinematics(**cast(Any, out))  # NumPy until all parts are joined
        return PhysicsState(engine=cast(Any, rows), kinematics=kinematics)

    def _put_balls(self, mask: np.ndarray, position: np.ndarray, velocity: np.ndarray) -> None:
        """Set the balls of the mask [B, Q]; they do not spin."""
        size, count = self._sizes, mask.shape[1]
        qpos = self._views["qpos"][:, size.qpos :].reshape(-1, count, 7)
        qvel = self._views["qvel"][:, size.qvel :].reshape(-1, count, 6)
        at = mask[..., None]
        qpos[..., :3] = np.where(at, position, qpos[..., :3])
        qvel[..., :3] = np.where(at, velocity, qvel[..., :3])
        qvel[..., 3:] = np.where(at, 0.0, qvel[..., 3:])
        self._views["qpos"][:, size.qpos :] = qpos.reshape(len(mask), -1)
        self._views["qvel"][:, size.qvel :] = qvel.reshape(len(mask), -1)

    def _write(self, failed: np.ndarray, out: dict[str, np.ndarray]) -> None:
        view, size = self._views, self._sizes
        links = slice(1, 1 + size.links)
        out["qpos"][...], out["qvel"][...] = (
            view["qpos"][:, : size.qpos],
            view["qvel"][:, : size.qvel],
        )
        out["torque"][...] = view["actuator_force"]
        position = view["xpos"][:, links]
        out["link_position"][...] = position
        out["link_quaternion"][...] = view["xquat"][:, links]
        angular, linear = view["cvel"][:, links, :3], view["cvel"][:, links, 3:]
        out["link_angular_velocity"][...] = angular
        # cvel's linear part is at the centre of mass of the whole tree; move it to the joint
        arm = position - view["subtree_com"][:, 1:2]
        out["link_linear_velocity"][...] = linear + np.cross(angular, arm)
        if size.balls:
            free = view["qvel"][:, size.qvel :].reshape(-1, size.balls, 6)
            out["prop_position"][...] = view["xpos"][:, links.stop :]
            out["prop_velocity"][...] = free[..., :3]
        speed = np.abs(view["qvel"]).max(axis=1)  # NaN compares as False
        finite = np.isfinite(view["qpos"]).all(axis=1) & (speed < _FAST_LIMIT)
        out["finite"][...] = finite & ~failed


def _without_autoreset(model: mujoco.MjModel) -> mujoco.MjModel:
    """A copy that keeps a diverged state, so that it can be seen, reset by the task and counted."""
    model = copy.copy(model)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    model.vis.global_.bvactive = 0
    return model
