"""What crosses between the parts: axes, physics state, environment contract.

One letter an axis, everywhere in the package:

    B simulations    T steps        K objectives    N samples
    J hinge joints (= actuators)    L links, the root first    P pool rows    Q balls

Units are SI: m, s, kg, N, Nm, rad. World frame: Z up. Quaternions: w x y z.
"""

from __future__ import annotations

import functools
from types import ModuleType
from typing import Any, Protocol

import chex
import jax
import jax.numpy as jnp
import numpy as np
from flax import struct


@struct.dataclass
class Kinematics:
    """The part of the physics state that tasks read; the same on all engines, float32."""

    qpos: jax.Array  # [B, 7 + J] root position and quaternion, then hinge angles (rad)
    qvel: jax.Array  # [B, 6 + J] root linear (world), angular (local), hinge rates (rad/s)
    link_position: jax.Array  # [B, L, 3] joint centre of every link, world (m)
    link_quaternion: jax.Array  # [B, L, 4] link to world, wxyz
    link_angular_velocity: jax.Array  # [B, L, 3] world frame (rad/s)
    link_linear_velocity: jax.Array  # [B, L, 3] of the joint centre, world frame (m/s)
    torque: jax.Array  # [B, J] actuator torque of the last substep (Nm)
    finite: jax.Array  # [B] bool; False: the simulation failed and must be reset
    prop_position: jax.Array | None = None  # [B, Q, 3] balls, world (m); None: there are none
    prop_velocity: jax.Array | None = None  # [B, Q, 3] world (m/s)


@struct.dataclass
class PropCommand:
    """Balls to put somewhere before a control step, as a hand does that holds or throws one."""

    mask: jax.Array  # [B, Q] bool, which ones
    position: jax.Array  # [B, Q, 3] world (m)
    velocity: jax.Array  # [B, Q, 3] world (m/s)


@struct.dataclass
class PhysicsState:
    """One batch of simulations: an opaque engine part and what tasks may read."""

    engine: Any  # rows of the engine's own state, leading axis B
    kinematics: Kinematics


class Engine(Protocol):
    """Steps B simulations. `step` is pure and may be called inside jit; B may differ by call."""

    name: str
    control_dt: float  # s, one control period
    compiler_options: dict[str, Any] | None  # for jitting what steps the engine outside training

    def place(self, qpos: Any, qvel: Any) -> PhysicsState:
        """States with the given qpos[P, 7 + J] and qvel[P, 6 + J]; pools are made of these."""
        ...

    def step(
        self,
        state: PhysicsState,
        ctrl: jax.Array,
        balls: PropCommand | None = None,
        wrench: jax.Array | None = None,
    ) -> PhysicsState:
        """One control period with hinge targets ctrl[B, J] (rad), balls put somewhere first.

        wrench [B, 6]: force (N) and torque (Nm), world frame, at the root's centre of mass.
        """
        ...


def select(mask: jax.Array, a: Any, b: Any) -> Any:
    """Per simulation: the rows of pytree a where mask[B], those of b elsewhere."""

    def pick(x: jax.Array, y: jax.Array) -> jax.Array:
        return jnp.where(mask.reshape(mask.shape + (1,) * (x.ndim - 1)), x, y)

    return jax.tree.map(pick, a, b)


def array_module(*arrays: object) -> ModuleType:
    """jax.numpy where one of the arrays is JAX's (traced ones are, too), else NumPy.

    One formula for compiled programs and for the host, where JAX would compile a program for
    every operation and shape that it meets.
    """
    return jnp if any(isinstance(array, jax.Array) for array in arrays) else np


@functools.partial(jax.jit, inline=True)  # outside of a program: one for all leaves
def take(rows: Any, index: jax.Array) -> Any:
    """Rows of a pool pytree: leaves [P, ...] at index[B] give leaves [B, ...]."""
    return jax.tree.map(lambda x: x[index], rows)


@struct.dataclass
class StepOutput:
    """What one environment step returns; `final_observation` is from before any reset."""

    observation: jax.Array  # [B, O] to act on next (after a reset, where one happened)
    final_observation: jax.Array  # [B, O] reached by this step, before the reset
    reward: jax.Array  # [B, K]
    terminated: jax.Array  # [B] bool, failure: no value beyond this step
    truncated: jax.Array  # [B] bool, time limit: the final observation's value bootstraps
    # name -> [B], what the rewards are made of; cause -> [B] bool, why episodes end early, all that
    # hold; name -> [B], what else is averaged over all steps
    terms: dict[str, jax.Array] = struct.field(default_factory=dict)
    ended: dict[str, jax.Array] = struct.field(default_factory=dict)
    metrics: dict[str, jax.Array] = struct.field(default_factory=dict)
    # name -> [B], verdicts on the episodes that are `done`: averaged over those and not NaN; NaN
    # says that the name means nothing for such an episode; elsewhere they say nothing
    episode: dict[str, jax.Array] = struct.field(default_factory=dict)
    extras: Any = None  # pytree [B, ...] that a learner stage needs (discriminator windows)

    @property
    def done(self) -> jax.Array:
        """[B] bool, where an episode ended in this step, and another one has begun."""
        return self.terminated | self.truncated

    @property
    def logged(self) -> dict[str, jax.Array]:
        """name -> [B], all that is averaged over steps: reward_TERM, ended_CAUSE, and metrics."""
        terms = {f"reward_{name}": value for name, value in self.terms.items()}
        ended = {f"ended_{name}": x.astype(jnp.float32) for name, x in self.ended.items()}
        return terms | ended | self.metrics


def check_output(env: Environment, action: jax.Array, output: StepOutput) -> None:
    """Raise AssertionError, as the step is traced, where an array is not as `StepOutput` says."""
    size, rows = action.shape[0], (action.shape[0],)
    chex.assert_shape(action, (size, env.action_size))
    seen = [output.observation, output.final_observation]
    chex.assert_shape(seen, (size, env.observation_size))
    chex.assert_shape(output.reward, (size, None))
    chex.assert_shape([output.terminated, output.truncated], rows)
    chex.assert_type([output.terminated, output.truncated, *output.ended.values()], bool)
    parts = (output.terms, output.ended, output.metrics, output.episode)
    chex.assert_shape([value for part in parts for value in part.values()], rows)


def check_control(state: PhysicsState, ctrl: jax.Array, wrench: jax.Array | None) -> None:
    """Raise AssertionError, as it is traced, where a command does not fit the simulations."""
    size = len(ctrl)
    if state.kinematics is not None:
        positions = state.kinematics.qpos.shape[-1]
        chex.assert_shape(state.kinematics.qpos, (size, positions))
        chex.assert_shape(ctrl, (size, positions - 7))
    if wrench is not None:
        chex.assert_shape(wrench, (size, 6))


class Environment(Protocol):
    """A batch of B episodes with automatic resets; pure functions of their arguments.

    An observation may start with a history of frames. The environment then has `frames`, their
    number F and size I, and the first F * I numbers are the frames, the oldest one first.

    It may have `stagger(state, key) -> state`: fresh episodes made to end at different times. A
    training begins with it, so that its episodes do not run in lockstep.

    One that has a mirror image has `symmetry`, which says what is mirrored how; see core/mirror.py.
    """

    @property
    def observation_size(self) -> int:
        """O."""
        ...

    @property
    def action_size(self) -> int:
        """A."""
        ...

    @property
    def num_objectives(self) -> int:
        """K."""
        ...

    def init(self, world: Any, key: jax.Array, num_envs: int) -> Any:
        """First state of B episodes: a pytree with a field `observation` [B, O]."""
        ...

    def step(self, world: Any, state: Any, action: jax.Array) -> tuple[Any, StepOutput]:
        """One step of action[B, A]; episodes that end are reset inside.

        Randomness comes from a key carried in the state.
        """
        ...
