from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from getup_jax.core import quaternion

RANDOM = Rotation.random(50, rng=np.random.default_rng(0))
OTHER = Rotation.random(50, rng=np.random.default_rng(1))
VECTORS = np.random.default_rng(2).normal(size=(50, 3))

PRONE = Rotation.from_rotvec([0.0, np.pi / 2, 0.0])  # the front of the upright pose turned down
SUPINE = Rotation.from_rotvec([0.0, -np.pi / 2, 0.0])
YAWS = np.linspace(-3.0, 3.0, 13)


def quat(r: Rotation) -> jnp.ndarray:
    return jnp.asarray(r.as_quat(scalar_first=True), jnp.float32)


def scipy(q) -> Rotation:
    return Rotation.from_quat(np.asarray(q), scalar_first=True)


def about(axis: str, radians) -> Rotation:
    return Rotation.from_rotvec(np.multiply.outer(radians, np.eye(3)["xyz".index(axis)]))


def yaw(radians) -> Rotation:
    return about("z", radians)


def assert_same_rotation(q, expected: Rotation, atol: float = 1e-5) -> None:
    assert float(np.max((scipy(q) * expected.inv()).magnitude())) < atol


def heading_of(r: Rotation) -> np.ndarray:
    """Heading angle (rad)."""
    return scipy(quaternion.heading(quat(r))).as_rotvec()[..., 2]


def test_multiply_is_scipys_composition():
    assert_same_rotation(quaternion.multiply(quat(RANDOM), quat(OTHER)), RANDOM * OTHER)


def test_rotate_is_scipys_apply():
    turned = quaternion.rotate(quat(RANDOM), jnp.asarray(VECTORS, jnp.float32))
    np.testing.assert_allclose(turned, RANDOM.apply(VECTORS), atol=1e-5)


def test_rotate_broadcasts_one_quaternion_over_vectors():
    turned = quaternion.rotate(quat(RANDOM[0])[None], jnp.asarray(VECTORS, jnp.float32))
    np.testing.assert_allclose(turned, RANDOM[0].apply(VECTORS), atol=1e-5)


def test_conjugate_is_the_inverse():
    assert_same_rotation(quaternion.conjugate(quat(RANDOM)), RANDOM.inv())
    one = quaternion.multiply(quat(RANDOM), quaternion.conjugate(quat(RANDOM)))
    np.testing.assert_allclose(one, np.tile([1, 0, 0, 0], (50, 1)), atol=1e-6)


def test_angle_is_scipys_magnitude():
    np.testing.assert_allclose(quaternion.angle(quat(RANDOM)), RANDOM.magnitude(), atol=1e-5)


def test_angle_is_the_same_for_q_and_minus_q():
    np.testing.assert_array_equal(quaternion.angle(-quat(RANDOM)), quaternion.angle(quat(RANDOM)))


@pytest.mark.parametrize("radians", [0.0, 1e-4, 1.0, np.pi - 1e-3, np.pi])
def test_angle_keeps_its_precision_at_both_ends(radians):
    got = quaternion.angle(quat(Rotation.from_rotvec([0.0, radians, 0.0])))
    assert float(got) == pytest.approx(radians, abs=1e-6)


def test_canonical_is_the_same_rotation_with_a_scalar_part_of_at_least_0():
    q = quat(RANDOM)
    both = jnp.concatenate([q, -q])
    got = quaternion.canonical(both)
    assert (np.asarray(both[:, 0]) < 0).any()
    assert (np.asarray(got[:, 0]) >= 0).all()
    np.testing.assert_array_equal(got[:50], got[50:])
    assert_same_rotation(got[:50], RANDOM)


def test_about_z():
    assert_same_rotation(quaternion.about_z(jnp.asarray(YAWS)), yaw(YAWS))


def test_heading_of_a_turn_about_the_vertical_is_the_turn():
    np.testing.assert_allclose(heading_of(yaw(YAWS)), YAWS, atol=1e-5)


@pytest.mark.parametrize("posture", [PRONE, SUPINE, Rotation.from_rotvec([0.4, -0.7, 0.0])])
def test_heading_ignores_a_tilt_about_a_horizontal_axis(posture):
    np.testing.assert_allclose(heading_of(yaw(YAWS) * posture), YAWS, atol=1e-5)


def test_a_turn_about_the_vertical_is_added_to_the_heading():
    for r in RANDOM[:4]:
        change = yaw(heading_of(yaw(YAWS) * r) - heading_of(r) - YAWS)
        np.testing.assert_allclose(change.magnitude(), 0.0, atol=1e-4)


def test_heading_is_continuous_in_a_whole_roll_on_the_floor():
    # rolling from prone over the side to supine and on, about the body's long axis
    roll = np.linspace(0.0, 2 * np.pi, 721)
    rolled = about("x", roll) * PRONE
    steps = np.diff(np.unwrap(heading_of(rolled)))
    np.testing.assert_allclose(steps, roll[1], atol=1e-4)


def test_heading_of_upside_down_is_the_identity():
    upside_down = quat(Rotation.from_rotvec([np.pi, 0.0, 0.0])).at[0].set(0.0)
    np.testing.assert_array_equal(quaternion.heading(upside_down), [1, 0, 0, 0])


def test_heading_is_a_unit_quaternion_about_the_vertical():
    q = np.asarray(quaternion.heading(quat(RANDOM)))
    np.testing.assert_allclose(np.linalg.norm(q, axis=-1), 1.0, atol=1e-6)
    np.testing.assert_array_equal(q[:, 1:3], 0.0)
