from __future__ import annotations

import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

from getup_jax.config import PhysicsConfig
from getup_jax.evaluation.motion_quality import (
    FootPoints,
    jerk,
    power,
    saturation,
    self_penetration,
)
from getup_jax.physics.character import CharacterSpec, load_character
from getup_jax.physics.native import NativeEngine
from getup_jax.physics.terrain import Terrain


@pytest.fixture(scope="module")
def character() -> CharacterSpec:
    return load_character(PhysicsConfig(engine="native"))


@pytest.fixture(scope="module")
def feet(character) -> FootPoints:
    return FootPoints.of(character)


def test_power_adds_what_every_hinge_works():
    torque, rate = jnp.array([[3.0, -1.0]]), jnp.array([[2.0, 4.0]])
    np.testing.assert_allclose(power(torque, rate), [10.0])


def test_jerk_of_a_cubic_is_its_third_derivative():
    # angle t^3 has the rate 3 t^2 and the jerk 6; the other hinge is still
    time = 0.5 * jnp.arange(2.0, 5.0)
    rates = jnp.stack([3 * time**2, jnp.zeros(3)], axis=-1)[:, None]
    np.testing.assert_allclose(jerk(rates, 0.5), [3.0])


def test_saturation_is_the_share_of_hinges_at_their_limit():
    torque = jnp.array([[99.5, -50.0, 10.0, -20.0], [98.0, 0.0, 0.0, 0.0]])
    limit = jnp.array([100.0, 50.0, 100.0, 100.0])
    np.testing.assert_allclose(saturation(torque, limit), [0.5, 0.0])


# Foot slip.


def slip_of(character, feet, change_qpos=None, change_qvel=None) -> float:
    """Slip of the neutral pose, with the soles on the ground, after the changes."""
    engine = NativeEngine(character, PhysicsConfig(engine="native"))
    qpos, qvel = character.neutral_qpos[None].copy(), np.zeros((1, character.model.nv))
    for change, array in ((change_qpos, qpos), (change_qvel, qvel)):
        if change is not None:
            change(array[0])
    return float(feet.slip(engine.place(qpos, qvel).kinematics, Terrain.flat())[0])


def test_the_corners_of_both_feet_touch_the_ground_of_a_standing_body(character, feet):
    assert len(feet.link) == 16
    assert slip_of(character, feet) == 0.0


def test_a_sliding_body_slips_with_its_speed(character, feet):
    def slide(qvel):
        qvel[:3] = 0.3, -0.4, 0.0

    assert slip_of(character, feet, change_qvel=slide) == pytest.approx(0.5, abs=1e-5)


def test_a_foot_that_is_lifted_does_not_slip(character, feet):
    def swing(qvel):
        qvel[6 + character.joint("shin_l_flex")] = -2.0

    def lift(qpos):
        qpos[2] += 0.02

    assert slip_of(character, feet, change_qvel=swing) > 0.1  # the left foot moves on the ground
    assert np.isnan(slip_of(character, feet, lift, swing))


def test_a_foot_that_rolls_over_its_edge_does_not_slip(character, feet):
    """The body turns about the line of its toes: other points move, those on the ground do not."""
    corners = feet.offset[feet.link == character.link("foot_l")]
    data = mujoco.MjData(character.model)
    data.qpos[:] = character.neutral_qpos
    mujoco.mj_kinematics(character.model, data)
    toes = data.body("foot_l").xpos + np.array([corners[:, 0].max(), 0.0, corners[:, 2].min()])
    pivot, angle = toes * [1, 0, 1], 0.3  # heels up

    def tip(qpos):
        turn = np.array([np.cos(angle / 2), 0.0, np.sin(angle / 2), 0.0])
        rotated = np.zeros(3)
        mujoco.mju_rotVecQuat(rotated, qpos[:3] - pivot, turn)
        qpos[:3] = pivot + rotated
        mujoco.mju_mulQuat(qpos[3:7], turn, qpos[3:7].copy())
        tip.arm = qpos[:3] - pivot

    def roll(qvel):
        rate = np.array([0.0, 1.5, 0.0])
        qvel[:3] = np.cross(rate, tip.arm)
        qvel[3:6] = rate  # the root's frame is turned about the same axis

    assert slip_of(character, feet, tip, roll) == pytest.approx(0.0, abs=1e-4)


# Links in each other.


def test_the_neutral_pose_does_not_overlap(character):
    lifted = character.neutral_qpos.copy()
    sunk = lifted.copy()
    sunk[2] -= 0.1  # the ground is no link
    assert self_penetration(character.model, np.stack([lifted, sunk])).tolist() == [0.0, 0.0]


def test_legs_that_cross_overlap_by_the_distance_of_their_geoms(character):
    model = character.model
    pose = character.neutral_qpos.copy()
    pose[7 + character.joint("thigh_l_abd")] -= 0.25
    pose[7 + character.joint("thigh_r_abd")] -= 0.25
    deepest = self_penetration(model, pose[None])[0]
    data = mujoco.MjData(model)
    data.qpos[:] = pose
    mujoco.mj_forward(model, data)
    depth = [-c.dist for c in data.contact if min(model.geom_bodyid[[c.geom1, c.geom2]]) > 0]
    assert deepest == pytest.approx(max(depth), abs=1e-6)
    assert deepest > 0.01


def test_a_failed_simulation_has_no_shape(character):
    pose = np.full((1, 56), np.nan)
    assert self_penetration(character.model, pose).tolist() == [0.0]
