from __future__ import annotations

import math

import jax.numpy as jnp
import numpy as np
import pytest

from getup_jax.envs.getup import rewards
from getup_jax.motion.getup import curves

RNG = np.random.default_rng(0)
N = 40


def uniform(low: float, high: float, *shape: int) -> jnp.ndarray:
    return jnp.asarray(RNG.uniform(low, high, shape), jnp.float32)


# Worked examples, by hand.


def test_height_10_cm_off():
    # exp(-1.7 * 0.1)
    assert float(rewards.height(jnp.array(1.3), jnp.array(1.4))) == pytest.approx(0.8436648)


def test_orientation_2_tenths_off_in_both_angles():
    # exp(-1.5 * (0.2 + 0.2))
    got = rewards.orientation(jnp.array([1.0, 2.0]), jnp.array([1.2, 1.8]))
    assert float(got) == pytest.approx(0.5488116)


def test_phase_at_nine_tenths_of_the_end():
    # exp(-20 * (1 - 0.9)) = exp(-2)
    assert float(rewards.phase(jnp.array(1.26), jnp.array(1.4))) == pytest.approx(0.1353353, 1e-4)


def test_velocity_of_a_3_4_5_triangle():
    omega = jnp.zeros(57).at[0].set(3.0).at[56].set(4.0)
    # norm 5: exp(-0.25), half of it
    assert float(rewards.velocity(omega, jnp.array(1.0))) == pytest.approx(0.7788008)
    assert float(rewards.velocity(omega, jnp.array(0.5))) == pytest.approx(0.5 + 0.5 * 0.7788008)


def test_posture_19_joints_each_a_tenth_off():
    # exp(-0.1 * 1.9)
    angles = jnp.full(19, 0.1)
    assert float(rewards.posture(angles, jnp.array(1.0))) == pytest.approx(0.8269591)
    assert float(rewards.posture(angles, jnp.array(0.2))) == pytest.approx(0.8 + 0.2 * 0.8269591)


@pytest.mark.parametrize(("each", "expected"), [(0.1, 1 - 0.49**2), (10 / 49, 0.0), (1.0, 0.0)])
def test_natural_of_49_equal_offsets(each, expected):
    # |dq|_1 = 49 * each, c = 10
    got = rewards.natural(jnp.full(49, each), 10.0)
    assert float(got) == pytest.approx(expected, abs=1e-6)


def test_natural_counts_negative_offsets():
    got = rewards.natural(jnp.array([3.0, -2.0]), 10.0)
    assert float(got) == pytest.approx(0.75)


def test_task_is_the_product_and_leaves_other_terms_out():
    terms = {"height": 0.9, "orientation": 0.8, "velocity": 0.7, "posture": 0.5, "natural": 0.1}
    terms = {name: jnp.asarray(value) for name, value in terms.items()}
    assert float(rewards.task(terms)) == pytest.approx(0.252)


# Identities.


def test_perfect_tracking_is_1():
    value, angles = uniform(0, 2, N), uniform(0, 3, N, 2)
    np.testing.assert_array_equal(rewards.height(value, value), 1.0)
    np.testing.assert_array_equal(rewards.orientation(angles, angles), 1.0)
    alpha = uniform(0, 1, N)
    np.testing.assert_allclose(rewards.velocity(jnp.zeros((N, 57)), alpha), 1.0, rtol=1e-6)
    np.testing.assert_allclose(rewards.posture(jnp.zeros((N, 19)), alpha), 1.0, rtol=1e-6)
    np.testing.assert_array_equal(rewards.natural(jnp.zeros((N, 49)), 10.0), 1.0)
    np.testing.assert_array_equal(rewards.phase(value, value), 1.0)


def test_rest_and_posture_do_not_count_while_rising():
    alpha = rewards.phase(jnp.array(0.2), jnp.array(1.4))
    assert float(alpha) < 1e-6
    assert float(rewards.velocity(jnp.full(57, 100.0), alpha)) == pytest.approx(1.0, abs=1e-5)
    assert float(rewards.posture(jnp.full(19, 3.0), alpha)) == pytest.approx(1.0, abs=1e-5)


def test_a_curve_that_overshoots_its_end_keeps_alpha_at_1_at_most():
    points = np.linspace([0.2, 1.5, 0.0], [1.4, 1.57, 1.57], curves.NUM_POINTS)
    points[6:8, 0] = 1.7
    height = curves.evaluate(jnp.asarray(points, jnp.float32), jnp.linspace(0, 1, 200))[:, 0]
    assert float(height.max()) > 1.5
    alpha = rewards.phase(height, jnp.asarray(points[-1, 0], jnp.float32))
    assert float(alpha.max()) == 1.0
    fast = rewards.velocity(jnp.full((200, 57), 50.0), alpha)
    assert float(fast.min()) >= 0.0


# Narrower kernels.


def test_tracking_10_cm_and_2_tenths_off_in_both_angles():
    # exp(-3 (1.7 * 0.1 + 1.5 (0.2 + 0.2)))
    found = rewards.terms(
        jnp.array([1.3, 1.2, 1.8]), jnp.array([1.4, 1.0, 2.0]), jnp.array(9.0),
        jnp.zeros(57), jnp.zeros(19),
    )  # fmt: skip
    assert float(rewards.tracking(found, 3.0)) == pytest.approx(math.exp(-3 * 0.77), rel=1e-5)
    np.testing.assert_allclose(rewards.tracking(found, 1.0), found["task"], rtol=1e-5)
    # the height twice as sharp: exp(-3 (2 * 1.7 * 0.1 + 1.5 (0.2 + 0.2)))
    sharper = float(rewards.tracking(found, 3.0, of_height=6.0))
    assert sharper == pytest.approx(math.exp(-3 * 0.94), rel=1e-5)


def test_sharpness_is_an_exponent_on_the_tracking_and_not_on_the_rest():
    found = {"height": 0.5, "orientation": 0.8, "velocity": 0.9, "posture": 0.7}
    found = {name: jnp.array(value) for name, value in found.items()}
    found["task"] = rewards.task(found)
    twice = 0.5**2 * 0.8**2 * 0.9 * 0.7
    assert float(rewards.sharpened(found, 2.0)) == pytest.approx(twice, rel=1e-6)
    assert float(rewards.sharpened(found, 1.0)) == float(found["task"])


# Slow references in NumPy.


def test_all_terms_against_numpy():
    value, target = uniform(0, 2, N, 3), uniform(0, 2, N, 3)
    final, omega, joint = uniform(1, 2, N), uniform(-9, 9, N, 57), uniform(0, 1, N, 19)
    offset = uniform(-0.4, 0.4, N, 49)
    got = rewards.terms(value, target, final, omega, joint)
    got |= {"natural": rewards.natural(offset, 10.0)}
    inputs = [np.asarray(x, np.float64) for x in (value, target, final, omega, joint, offset)]
    expected = [slow_terms(*row) for row in zip(*inputs, strict=True)]
    for name, term in got.items():
        np.testing.assert_allclose(term, [row[name] for row in expected], rtol=1e-3, atol=1e-5)


def slow_terms(value, target, final, omega, joint, offset) -> dict[str, float]:
    """Equations 3 to 9 of one row, with loops and doubles."""
    alpha = math.exp(-20 * (1 - min(target[0] / final, 1.0)))
    terms = {
        "height": math.exp(-1.7 * abs(value[0] - target[0])),
        "orientation": math.exp(-1.5 * (abs(value[1] - target[1]) + abs(value[2] - target[2]))),
        "velocity": 1 - alpha + alpha * math.exp(-0.05 * math.sqrt(sum(x**2 for x in omega))),
        "posture": 1 - alpha + alpha * math.exp(-0.1 * sum(joint)),
    }
    terms["task"] = math.prod(terms.values())
    terms["natural"] = 1 - min((sum(abs(x) for x in offset) / 10) ** 2, 1.0)
    return terms
