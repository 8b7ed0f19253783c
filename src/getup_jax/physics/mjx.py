"""The MJX engine: the same character on a GPU or TPU, or on a CPU for parity tests.

Between steps only positions, velocities and the solver's warm start are carried; everything
else that MJX keeps is derived from them at the start of a step.
"""

from __future__ import annotations

import copy
import functools
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from flax import struct
from mujoco import mjx

from getup_jax.config import ConfigError, PhysicsConfig
from getup_jax.core.types import Kinematics, PhysicsState, PropCommand, check_control
from getup_jax.physics.character import CharacterSpec
from getup_jax.physics.props import with_balls


@struct.dataclass
class MjxState:
    """What one simulation remembers."""

    qpos: jax.Array  # [B, 7 + J]
    qvel: jax.Array  # [B, 6 + J]
    warmstart: jax.Array  # [B, 6 + J] last acceleration, the solver's first guess


# Room that warp keeps for each simulation; it drops what does not fit, with a warning. Bodies that
# lie on slopes have up to 26 contacts and 109 constraints.
_CONTACTS = 64  # on average over all
_CONSTRAINTS = 384  # in any one

# By default XLA takes more than twice as long to compile a step for a CPU, and the result is
# slower. These options change it by rounding alone.
CPU_COMPILER_OPTIONS = {
    "xla_backend_optimization_level": 0,
    "xla_llvm_disable_expensive_passes": True,
    "xla_cpu_use_fusion_emitters": False,
}


class MjxEngine:
    """Steps batches of one character with MJX, in float32."""

    def __init__(self, character: CharacterSpec, config: PhysicsConfig, impl: str):
        self.name = "mjx" if impl == "jax" else f"mjx-{impl}"
        self.control_dt = 1.0 / config.control_hz
        self.compiler_options = CPU_COMPILER_OPTIONS if jax.default_backend() == "cpu" else None
        self._substeps = config.substeps
        self._sizes = len(character.link_names), 7 + character.num_joints
        model = copy.copy(character.scene)
        self._scene = model
        if model.opt.solver == mujoco.mjtSolver.mjSOL_PGS:
            model.opt.solver = mujoco.mjtSolver.mjSOL_NEWTON
        self._impl = impl
        self._model = _put_model(model, impl)
        # MJX derives link velocities with its jax implementation alone
        self._frames_model = self._model if impl == "jax" else mjx.put_model(model, impl="jax")
        self._frames_data = mjx.make_data(model, impl="jax")

    def place(self, qpos: Any, qvel: Any) -> PhysicsState:
        """See `Engine.place`."""
        qpos, qvel = with_balls(np.asarray(qpos), np.asarray(qvel), self._scene)
        qpos, qvel = jnp.asarray(qpos, jnp.float32), jnp.asarray(qvel, jnp.float32)
        state = MjxState(qpos=qpos, qvel=qvel, warmstart=jnp.zeros_like(qvel))
        return _place(self, state)

    def step(
        self,
        state: PhysicsState,
        ctrl: jax.Array,
        balls: PropCommand | None = None,
        wrench: jax.Array | None = None,
    ) -> PhysicsState:
        """See `Engine.step`."""
        check_control(state, ctrl, wrench)
        ctrl = jnp.nan_to_num(ctrl)
        if balls is not None:
            state = state.replace(engine=self._put_balls(state.engine, balls))
        step = functools.partial(self._step_one, self._buffers(len(ctrl)))
        step = jax.vmap(step, in_axes=(0, 0, None if wrench is None else 0))
        engine, kinematics = step(state.engine, ctrl, wrench)
        return PhysicsState(engine=engine, kinematics=kinematics)

    def _buffers(self, size: int) -> Any:
        """Fresh data for one of `size` simulations; warp keeps the contacts of all in one list."""
        if self._impl == "jax":
            return self._frames_data
        return mjx.make_data(
            self._scene, impl=self._impl, naconmax=size * _CONTACTS, njmax=_CONSTRAINTS
        )

    def _put_balls(self, state: MjxState, balls: PropCommand) -> MjxState:
        """Set the balls of the mask; they do not spin."""
        size, at = self._sizes[1], balls.mask[..., None]
        count = balls.mask.shape[:2]
        qpos = state.qpos[:, size:].reshape(*count, 7)
        qvel = state.qvel[:, size - 1 :].reshape(*count, 6)
        qpos = qpos.at[..., :3].set(jnp.where(at, balls.position, qpos[..., :3]))
        still = jnp.zeros_like(balls.velocity)
        moving = jnp.concatenate([balls.velocity, still], axis=-1)
        qvel = jnp.where(at, moving, qvel)
        return state.replace(
            qpos=state.qpos.at[:, size:].set(qpos.reshape(count[0], -1)),
            qvel=state.qvel.at[:, size - 1 :].set(qvel.reshape(count[0], -1)),
        )

    def _step_one(
        self, data: Any, state: MjxState, ctrl: jax.Array, wrench: jax.Array | None
    ) -> tuple[MjxState, Kinematics]:
        data = _load(data, state)
        if wrench is not None:
            data = data.replace(xfrc_applied=data.xfrc_applied.at[1].set(jnp.nan_to_num(wrench)))

        def substep(data: Any, _: None) -> tuple[Any, None]:
            model, limited = self._limit_servos(data.replace(ctrl=ctrl))
            return mjx.step(model, limited), None

        data, _ = jax.lax.scan(substep, data, None, length=self._substeps)
        after = MjxState(qpos=data.qpos, qvel=data.qvel, warmstart=data.qacc_warmstart)
        return after, self._kinematics(after, data.actuator_force)

    def _limit_servos(self, data: Any) -> tuple[Any, Any]:
        """Turn the servos that reach their torque limit into constant torques.

        MuJoCo leaves a limited servo out of the implicit integration, MJX does not. Written as
        constant torques they have no derivative, and both engines do the same.
        """
        model = self._model
        gain, bias = model.actuator_gainprm[:, 0], model.actuator_biasprm
        joints = self._sizes[1]
        rates = data.qvel[6 : joints - 1]
        force = gain * data.ctrl + bias[:, 1] * data.qpos[7:joints] + bias[:, 2] * rates
        lower, upper = model.actuator_forcerange.T
        limited = (force < lower) | (force > upper)
        ctrl = jnp.where(limited, jnp.clip(force, lower, upper) / gain, data.ctrl)
        bias = jnp.where(limited[:, None], 0.0, bias)
        return model.replace(actuator_biasprm=bias), data.replace(ctrl=ctrl)

    def _place_one(self, state: MjxState) -> Kinematics:
        return self._kinematics(state, jnp.zeros(self._model.nu))

    def _kinematics(self, state: MjxState, torque: jax.Array) -> Kinematics:
        """Link motion at the state's own positions; `step` leaves that of one substep ago."""
        model = self._frames_model
        data = mjx.kinematics(model, _load(self._frames_data, state))
        data = mjx.com_pos(model, data)
        data = mjx.com_vel(model, data)
        links, joints = slice(1, 1 + self._sizes[0]), self._sizes[1]
        cvel, position = data.cvel[links], data.xpos[links]
        balls = data.qvel[joints - 1 :].reshape(-1, 6)
        angular = cvel[:, :3]
        arm = position - data.subtree_com[1]
        finite = jnp.isfinite(data.qpos).all() & jnp.isfinite(data.qvel).all()
        return Kinematics(
            qpos=data.qpos[:joints],
            qvel=data.qvel[: joints - 1],
            link_position=position,
            link_quaternion=data.xquat[links],
            link_angular_velocity=angular,
            link_linear_velocity=cvel[:, 3:] + jnp.cross(angular, arm),
            torque=torque,
            finite=finite,
            prop_position=data.xpos[links.stop :] if len(balls) else None,
            prop_velocity=balls[:, :3] if len(balls) else None,
        )


def _load(data: Any, state: MjxState) -> Any:
    return data.replace(qpos=state.qpos, qvel=state.qvel, qacc_warmstart=state.warmstart)


@functools.partial(jax.jit, static_argnums=0)
def _place(engine: MjxEngine, state: MjxState) -> PhysicsState:
    kinematics = jax.vmap(engine._place_one)(state)
    return PhysicsState(engine=state, kinematics=kinematics)


def _put_model(model: mujoco.MjModel, impl: str) -> Any:
    try:
        return mjx.put_model(model, impl=impl)
    except (ImportError, RuntimeError, AttributeError) as error:
        raise ConfigError(
            f"physics.engine: MJX cannot use impl {impl!r} here ({error}); for mjx-warp install "
            "the extra: pip install 'getup-jax[warp]'"
        ) from error
