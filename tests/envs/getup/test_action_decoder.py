from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest
from tiny_task import CONFIG, LATENT, untrained_prior

from getup_jax.envs.getup.action_decoder import ActionDecoder

SCALE = 0.25
LIMIT = CONFIG.task.offset_limit_rad


@pytest.fixture(scope="module")
def units(character) -> ActionDecoder:
    return ActionDecoder(untrained_prior(character), SCALE)


@pytest.fixture(scope="module")
def angles(character):
    """Two poses [2, 49]: one near the neutral pose and a limp one, far from all of the prior's."""
    rng = np.random.default_rng(0)
    noise = np.array([[0.02], [0.5]]) * rng.choice([-1.0, 1.0], (2, 49))
    return jnp.asarray(character.neutral_qpos[7:] + noise, jnp.float32)


@pytest.fixture(scope="module")
def condition():
    return jnp.tile(jnp.array([0.1, 1.57, 3.0]), (2, 1))


def sums(action) -> np.ndarray:
    """|dq|_1 (rad) of actions."""
    return SCALE * np.abs(np.asarray(action)[:, LATENT:]).sum(axis=1)


def test_a_start_is_held_exactly_however_far_from_the_prior(units, angles, condition):
    first = units.first(angles, condition)
    assert sums(first).max() > LIMIT
    np.testing.assert_allclose(units.target(first, condition), angles, atol=1e-5)


def test_the_offsets_that_hold_a_start_pose_are_nobodys(units, angles, condition):
    first, unasked = units.begin(angles, condition, None)
    np.testing.assert_array_equal(unasked, units.offset(first))
    given = jnp.full_like(first, jnp.nan).at[0].set(0.5)  # the first start brings an action
    action, unasked = units.begin(angles, condition, given)
    np.testing.assert_array_equal(action, jnp.stack([given[0], first[1]]))
    np.testing.assert_array_equal(unasked, jnp.stack([jnp.zeros(49), units.offset(first)[1]]))


def test_offsets_that_do_nothing_are_none(character, angles, condition):
    without = ActionDecoder(untrained_prior(character), 0.0)
    action = np.asarray(without.action(angles, angles, condition))
    np.testing.assert_array_equal(action[:, LATENT:], 0.0)
    assert np.isfinite(action).all()


def test_without_a_prior_the_pose_is_held_whatever_the_sum(character, angles, condition):
    neutral = jnp.asarray(character.neutral_qpos[7:], jnp.float32)
    bare = ActionDecoder(None, SCALE, neutral)
    first, unasked = bare.begin(angles, condition, None)
    np.testing.assert_allclose(bare.target(first, condition), angles, atol=1e-5)
    assert unasked is None  # without a prior no offset is unnatural
