"""MJX against the native engine; both with Newton, since MJX has no PGS."""

from __future__ import annotations

import dataclasses
import importlib.util
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from poses import random_targets

from getup_jax.config import ConfigError, PhysicsConfig
from getup_jax.physics.engine import make_engine
from getup_jax.physics.mjx import MjxState
from getup_jax.types import Kinematics, PhysicsState

CONFIG = PhysicsConfig(engine="mjx", solver="newton")
BATCH = 4

# XLA's default for a CPU takes about three times as long to compile the step. The results differ
# by rounding only.
QUICK_COMPILE = {
    "xla_backend_optimization_level": 0,
    "xla_llvm_disable_expensive_passes": True,
    "xla_cpu_use_fusion_emitters": False,
}

Play = Callable[[np.ndarray, np.ndarray, np.ndarray], tuple[Kinematics, Kinematics]]


@pytest.fixture(scope="module")
def play(character) -> Play:
    """Kinematics [T, B, ...] of (MJX, native) from qpos, qvel under targets [T, B, J]."""
    mjx = make_engine(character, CONFIG)
    native = make_engine(character, dataclasses.replace(CONFIG, engine="native"))
    steps = {
        "mjx": jax.jit(mjx.step, compiler_options=QUICK_COMPILE),
        "native": jax.jit(native.step),
    }

    def run(qpos: np.ndarray, qvel: np.ndarray, targets: np.ndarray):
        q, v = jnp.asarray(qpos, jnp.float32), jnp.asarray(qvel, jnp.float32)
        blank = native.place(qpos, qvel)
        # `place` of MJX would be another compilation; a step reads no kinematics
        first = MjxState(qpos=q, qvel=v, warmstart=jnp.zeros_like(v))
        states = {"mjx": blank.replace(engine=first), "native": blank}
        return tuple(_loop(steps[name], states[name], targets) for name in ("mjx", "native"))

    return run


def _loop(step: Callable, state: PhysicsState, targets: np.ndarray) -> Kinematics:
    seen = []
    for ctrl in targets:
        state = step(state, jnp.asarray(ctrl, jnp.float32))
        seen.append(jax.tree.map(np.asarray, state.kinematics))
    return jax.tree.map(lambda *x: np.stack(x), *seen)
