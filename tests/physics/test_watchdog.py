"""A callback that waits for JAX can hang, and only with large batches on few CPUs."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

TIMEOUT_S = 300

PROGRAM = """
import os
os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})

import jax
import jax.numpy as jnp
import numpy as np

from getup_jax.config import PhysicsConfig
from getup_jax.physics.character import load_character
from getup_jax.physics.native import NativeEngine

config, size = PhysicsConfig(engine="native"), 2048
character = load_character(config)
engine = NativeEngine(character, config)
first = engine.place(np.tile(character.neutral_qpos, (size, 1)), np.zeros((size, 55)))
weight = jnp.full((56, 49), 1e-3)


def step(state, _):
    # with work for XLA's own threads around the callback
    return engine.step(state, state.kinematics.qpos @ weight), None


state, _ = jax.jit(lambda state: jax.lax.scan(step, state, None, length=3))(first)
print("finite:", int(jnp.sum(state.kinematics.finite)), "of", size)
"""


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="needs Linux")
def test_a_large_batch_does_not_hang_on_one_cpu():
    environment = {**os.environ, "JAX_PLATFORMS": "cpu"}
    result = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        env=environment, capture_output=True, text=True, timeout=TIMEOUT_S, check=False,
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    assert "finite: 2048 of 2048" in result.stdout
