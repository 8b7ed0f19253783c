"""The composite-motion character against the published figures, and its physics at rest."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from getup_jax.config import PhysicsConfig
from getup_jax.physics.character import CharacterSpec, load_character

# Xu et al. 2023 and its release: stiffness (Nm/rad) and torque limit (Nm) of each joint's hinges,
# and the limits of the 28-DoF humanoid of AMP (degrees: flexion, abduction, twist).
SERVOS = {
    "torso": (600, 125, (-60, 90), (-60, 60), (-50, 50)),
    "head": (50, 20, (-40, 60), (-50, 50), (-45, 45)),
    "arm": (200, 70, (-60, 180), (-45, 180), (-90, 90)),
    "forearm": (150, 60, (-160, 0)),
    "thigh": (300, 125, (-45, 120), (-15, 45), (-35, 60)),
    "shin": (300, 100, (-160, 0)),
    "foot": (200, 50, (-55, 55), (-30, 30), (-40, 40)),
}
MASSES = {
    "pelvis": 10, "torso": 12, "head": 3.9, "arm": 1.5, "forearm": 1, "hand": 0.5,
    "thigh": 4.5, "shin": 3, "foot": 1,
}  # fmt: skip


@pytest.fixture(scope="module")
def character() -> CharacterSpec:
    """With the physics settings of the paper: 120 Hz, plain PD, no passive damping."""
    return load_character(
        PhysicsConfig(character="humanoid28", substeps=4, gain_scale=1, armature=0.02, damping=0)
    )


def standing(character: CharacterSpec) -> mujoco.MjData:
    data = mujoco.MjData(character.model)
    data.qpos[:] = character.neutral_qpos
    data.ctrl[:] = character.neutral_qpos[7:]
    mujoco.mj_forward(character.model, data)
    return data


def test_it_has_fifteen_links_and_the_published_masses(character):
    assert len(character.link_names) == 15
    assert character.num_joints == character.model.nu == 28
    model = character.model
    masses = {name: float(model.body(name).mass[0]) for name in character.link_names}
    for name, mass in masses.items():
        assert mass == pytest.approx(MASSES[name.removesuffix("_l").removesuffix("_r")]), name
    assert sum(masses.values()) == pytest.approx(48.9)
    assert model.opt.timestep == pytest.approx(1 / 120)


def test_servos_and_limits_are_the_published_ones(character):
    for joint, name in enumerate(character.joint_names):
        link, axis = name.rsplit("_", 1)
        stiffness, torque, *limits = SERVOS[link.removesuffix("_l").removesuffix("_r")]
        lower, upper = limits[("flex", "abd", "twist").index(axis)]
        assert character.torque_limit[joint] == torque, name
        assert character.model.actuator_gainprm[joint, 0] == stiffness, name
        assert character.model.actuator_biasprm[joint, 2] == pytest.approx(-stiffness / 10), name
        assert np.degrees(character.joint_lower[joint]) == pytest.approx(lower), name
        assert np.degrees(character.joint_upper[joint]) == pytest.approx(upper), name


def test_neutral_touches_the_floor_with_the_feet_alone(character):
    data = standing(character)
    model = character.model
    pairs = {frozenset((model.geom(c.geom1).name, model.geom(c.geom2).name)) for c in data.contact}
    assert pairs == {frozenset(("floor", "foot_l")), frozenset(("floor", "foot_r"))}
    assert min(c.dist for c in data.contact) > -0.002


def test_it_stands_quietly_under_its_servos(character):
    data = standing(character)
    for _ in range(120):
        mujoco.mj_step(character.model, data)
    assert data.qpos[2] == pytest.approx(character.neutral_qpos[2], abs=0.003)
    assert np.linalg.norm(data.cvel[1:, :3]) < 0.05


def test_the_mirror_image_of_a_pose_swaps_the_sides(character):
    qpos = np.array(character.neutral_qpos)
    rng = np.random.default_rng(0)
    qpos[7:] = rng.uniform(character.joint_lower, character.joint_upper)
    places = []
    for pose in (qpos, character.mirror(qpos)):
        data = mujoco.MjData(character.model)
        data.qpos[:] = pose
        mujoco.mj_kinematics(character.model, data)
        places.append(data.xpos[1:].copy())
    swap = {"_l": "_r", "_r": "_l"}
    names = [n[:-2] + swap[n[-2:]] if n[-2:] in swap else n for n in character.link_names]
    expected = places[0][character.links(names)] * [1, -1, 1]
    np.testing.assert_allclose(places[1], expected, atol=1e-9)
