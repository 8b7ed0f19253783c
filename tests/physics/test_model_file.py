"""The written model is the simulated one, to the six digits that MJCF is written with."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from getup_jax.config import PhysicsConfig
from getup_jax.physics.character import load_character
from getup_jax.physics.model_file import character_xml

CONFIGS = [
    PhysicsConfig(),
    PhysicsConfig(
        character="humanoid28", gain_scale=0.7, torque_scale=1.3, armature=0.03, damping=0.2
    ),
]


@pytest.mark.parametrize("config", CONFIGS, ids=lambda c: c.character)
def test_the_file_compiles_to_the_characters_model(config):
    written = mujoco.MjModel.from_xml_string(character_xml(config))
    model = load_character(config).model
    for name in dir(model):
        value = getattr(model, name)
        if isinstance(value, np.ndarray) and value.dtype.kind == "f":
            np.testing.assert_allclose(getattr(written, name), value, atol=1e-5, err_msg=name)
    for name in ("solver", "iterations", "integrator", "disableflags"):
        assert getattr(written.opt, name) == getattr(model.opt, name)
    assert written.opt.timestep == pytest.approx(model.opt.timestep, abs=1e-6)
