"""Forward kinematics in JAX against MuJoCo."""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from getup_jax.config import ConfigError, PhysicsConfig
from getup_jax.physics.character import load_character
from getup_jax.physics.forward_kinematics import LinkTree, kinematics
from getup_jax.physics.native import NativeEngine

FIELDS = "link_position", "link_quaternion", "link_angular_velocity", "link_linear_velocity"


@pytest.mark.parametrize("name", ["humanoid49", "humanoid28"])
def test_links_are_where_mujoco_has_them(name):
    config = PhysicsConfig(character=name)
    character = load_character(config)
    rng = np.random.default_rng(0)
    qpos = rng.normal(size=(5, 7 + character.num_joints)).astype(np.float32)
    qvel = rng.normal(size=(5, 6 + character.num_joints)).astype(np.float32)
    reference = NativeEngine(character, config).place(qpos, qvel).kinematics
    found = kinematics(LinkTree.of(character), jnp.asarray(qpos), jnp.asarray(qvel))
    for field in FIELDS:
        np.testing.assert_allclose(getattr(found, field), getattr(reference, field), atol=1e-5)
    one = kinematics(LinkTree.of(character), jnp.asarray(qpos[3]), jnp.asarray(qvel[3]))
    np.testing.assert_allclose(one.link_position, found.link_position[3], atol=1e-6)


def test_a_hinge_beside_its_link_is_refused():
    character = load_character(PhysicsConfig())
    import copy

    model = copy.copy(character.model)
    model.jnt_pos[5] = 0.01, 0.0, 0.0
    with pytest.raises(ConfigError, match="every hinge at the origin of its link"):
        LinkTree.of(dataclasses.replace(character, model=model))
