"""The native engine: `mujoco.batch.Batch` on a thread pool, called inside jit.

A simulation's whole state is its float64 integration-state row. JAX carries the rows as
uint32[B, 2 * nstate], bit for bit, so that a step is a pure function of its arguments: no
ordering tokens, exact checkpoints, and a reset is a `where` on rows.

The host function never touches jax: a jitted call inside a callback hangs for large batches.
"""

from __future__ import annotations

import copy
import os
import threading
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from jax.experimental.buffer_callback import buffer_callback
from mujoco.batch import Batch, SimulationError

from getup_jax.config import PhysicsConfig
from getup_jax.physics.character import CharacterSpec
from getup_jax.types import Kinematics, PhysicsState

_STAGE = mujoco.mjtStage.mjSTAGE_VEL.value
_FAST_LIMIT = 1e4  # rad/s or m/s; a state past it has diverged


class NativeEngine:
    """Steps batches of one character with MuJoCo's own batch stepper, in float64."""

    name = "native"
    compiler_options: dict[str, Any] | None = None

    def __init__(self, character: CharacterSpec, config: PhysicsConfig):
        self.model = _without_autoreset(character.model)
        self.control_dt = 1.0 / config.control_hz
        self._substeps = config.substeps
        self._threads = config.threads or len(os.sched_getaffinity(0))
        self._batches: dict[int, _HostBatch] = {}
        self._lock = threading.Lock()

    def place(self, qpos: Any, qvel: Any) -> PhysicsState:
        """See `Engine.place`; runs on the host."""
        qpos, qvel = np.asarray(qpos, np.float64), np.asarray(qvel, np.float64)
        batch = self._batch(len(qpos))
        return batch.place(qpos, qvel)

    def step(self, state: PhysicsState, ctrl: jax.Array) -> PhysicsState:
        """See `Engine.step`."""
        batch = self._batch(ctrl.shape[0])
        call = buffer_callback(batch.step, batch.result_shapes, vmap_method=None)
        rows, kinematics = call(state.engine, ctrl.astype(jnp.float32))
        return PhysicsState(engine=rows, kinematics=Kinematics(**kinematics))

    def _batch(self, size: int) -> _HostBatch:
        # one set of MjData per batch size, made when it is first asked for
        with self._lock:
            if size not in self._batches:
                self._batches[size] = _HostBatch(self.model, size, self._threads, self._substeps)
            return self._batches[size]


class _HostBatch:
    """The host side of one batch size: NumPy only."""

    def __init__(self, model: mujoco.MjModel, size: int, threads: int, substeps: int):
        # persistent: the stage at the end of a step is not computed again by the next one
        self._batch = Batch(model, size, min(threads, size), persistent=True)
        self._substeps = substeps
        fields = ("qpos", "qvel", "ctrl", "xpos", "xquat", "cvel", "subtree_com", "actuator_force")
        self._views = {name: self._batch.bind(name) for name in fields}
        links = model.nbody - 1
        shapes = {
            "qpos": (model.nq,),
            "qvel": (model.nv,),
            "link_position": (links, 3),
            "link_quaternion": (links, 4),
            "link_angular_velocity": (links, 3),
            "link_linear_velocity": (links, 3),
            "torque": (model.nu,),
        }
        kinematics = {k: jax.ShapeDtypeStruct((size, *s), np.float32) for k, s in shapes.items()}
        kinematics["finite"] = jax.ShapeDtypeStruct((size,), np.bool_)
        rows = jax.ShapeDtypeStruct((size, 2 * self._batch.nstate), np.uint32)
        self.result_shapes = (rows, kinematics)

    def step(self, _: Any, out: Any, rows: Any, ctrl: Any) -> None:
        """One control period, from rows and ctrl into the output buffers."""
        self._batch.state[...] = np.asarray(rows).view(np.float64)
        self._views["ctrl"][...] = np.nan_to_num(np.asarray(ctrl))
        failed = np.zeros(self._batch.nsim, bool)
        try:
            self._batch.step(nstep=self._substeps, stage=_STAGE)
        except SimulationError as error:
            failed[error.ids] = True
        out_rows, out_kinematics = out
        np.asarray(out_rows)[...] = self._batch.state.view(np.uint32)
        self._write(failed, {name: np.asarray(buffer) for name, buffer in out_kinematics.items()})

    def place(self, qpos: np.ndarray, qvel: np.ndarray) -> PhysicsState:
        """Rows and kinematics at the given positions and velocities, ctrl = hinge angles."""
        self._batch.reset(stage=mujoco.mjtStage.mjSTAGE_NONE.value)
        self._views["qpos"][...], self._views["qvel"][...] = qpos, qvel
        self._views["ctrl"][...] = qpos[:, 7:]
        self._batch.forward()
        rows = self._batch.state.view(np.uint32).copy()
        out = {k: np.empty(s.shape, s.dtype) for k, s in self.result_shapes[1].items()}
        self._write(np.zeros(len(qpos), bool), out)
        kinematics = Kinematics(**{name: jnp.asarray(value) for name, value in out.items()})
        return PhysicsState(engine=jnp.asarray(rows), kinematics=kinematics)

    def _write(self, failed: np.ndarray, out: dict[str, np.ndarray]) -> None:
        view = self._views
        out["qpos"][...], out["qvel"][...] = view["qpos"], view["qvel"]
        out["torque"][...] = view["actuator_force"]
        position = view["xpos"][:, 1:]
        out["link_position"][...] = position
        out["link_quaternion"][...] = view["xquat"][:, 1:]
        angular, linear = view["cvel"][:, 1:, :3], view["cvel"][:, 1:, 3:]
        out["link_angular_velocity"][...] = angular
        # cvel's linear part is at the centre of mass of the whole tree; move it to the joint
        arm = position - view["subtree_com"][:, 1:2]
        out["link_linear_velocity"][...] = linear + np.cross(angular, arm)
        speed = np.abs(view["qvel"]).max(axis=1)  # NaN compares as False
        finite = np.isfinite(view["qpos"]).all(axis=1) & (speed < _FAST_LIMIT)
        out["finite"][...] = finite & ~failed


def _without_autoreset(model: mujoco.MjModel) -> mujoco.MjModel:
    """A copy that keeps a diverged state, so that it can be seen, reset by the task and counted."""
    model = copy.copy(model)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    model.vis.global_.bvactive = 0
    return model
