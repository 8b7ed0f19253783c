from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from getup_jax.config import PhysicsConfig
from getup_jax.physics.character import CharacterSpec, load_character
from getup_jax.physics.mirror_image import is_symmetric, joint_mirror, link_images
from getup_jax.physics.props import Equipment


def load(name: str, equipment: Equipment | None = None) -> CharacterSpec:
    return load_character(PhysicsConfig(character=name), equipment=equipment)


@pytest.fixture(scope="module", params=["humanoid49", "humanoid28"])
def shipped(request) -> CharacterSpec:
    return load(request.param)


def test_the_shipped_characters_are_symmetric(shipped):
    assert is_symmetric(shipped)


def test_a_racket_in_one_hand_is_not():
    assert not is_symmetric(load("humanoid28", Equipment(racket=True)))


CHANGES = {
    "mass": lambda spec: _set(spec.model.body_mass, spec.link("hand_l") + 1, 3.0),
    "place": lambda spec: _set(spec.model.body_pos, (spec.link("foot_r") + 1, 2), -0.5),
    "geom": lambda spec: _set(spec.model.geom_size, (spec.model.geom("hand_l").id, 0), 0.2),
    "damping": lambda spec: _set(spec.model.dof_damping, 6 + spec.joint("thigh_l_flex"), 9.0),
    "servo": lambda spec: _set(spec.model.actuator_gainprm, (spec.joint("arm_l_abd"), 0), 1.0),
    "limit": lambda spec: _set(spec.joint_upper, spec.joint("spine_mid_twist"), 2.0),
}


def _set(array: np.ndarray, index: Any, value: float) -> None:
    array[index] = value


@pytest.mark.parametrize("name", CHANGES)
def test_any_difference_between_the_sides_is_seen(name):
    spec = load("humanoid49")
    CHANGES[name](spec)
    assert not is_symmetric(spec)


def test_what_is_the_same_on_both_sides_is_no_difference():
    spec = load("humanoid49")
    _set(spec.model.geom_size, (spec.model.geom("head").id, 0), 0.2)
    assert is_symmetric(spec)


def test_hinges_without_an_image_are_seen():
    spec = load("humanoid49")
    wrong = np.roll(spec.mirror_joint, 1)
    assert not is_symmetric(dataclasses.replace(spec, mirror_joint=wrong))


def test_hinges_are_mirrored_as_poses_are(shipped):
    rng = np.random.default_rng(0)
    qpos = rng.normal(size=(5, 7 + shipped.num_joints))
    np.testing.assert_array_equal(joint_mirror(shipped)(qpos[:, 7:]), shipped.mirror(qpos)[:, 7:])


def test_links_change_sides(shipped):
    names, images = shipped.link_names, link_images(shipped)
    assert names[images[shipped.link("hand_l")]] == "hand_r"
    assert names[images[shipped.link("pelvis")]] == "pelvis"
    np.testing.assert_array_equal(images[images], np.arange(len(names)))
