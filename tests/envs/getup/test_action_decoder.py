from __future__ import annotations

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from tiny_task import CONFIG, LATENT, untrained_prior

from getup_jax.envs.getup.action_decoder import ActionDecoder
from getup_jax.envs.getup.rewards import natural

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


def test_a_pose_within_the_budget_is_held_exactly(units, angles, condition):
    far = sums(units.action(angles, angles, condition)).max()
    held = units.hold(angles, condition, far + 1.0)
    np.testing.assert_allclose(units.target(held, condition), angles, atol=1e-5)


def test_beyond_it_the_target_lies_between_the_priors_pose_and_the_start(units, angles, condition):
    exact = units.action(angles, angles, condition)
    most = 0.5 * sums(exact).min()
    held = units.hold(angles, condition, most)
    np.testing.assert_allclose(sums(held), most, rtol=1e-5)
    near, share = units.pose(exact, condition), most / sums(exact)[:, None]
    expected = near + share * (angles - near)
    np.testing.assert_allclose(units.target(held, condition), expected, atol=1e-5)


def test_after_a_limp_start_the_natural_reward_is_on_from_the_first_step(units, angles, condition):
    task = dataclasses.replace(CONFIG.task, limp_share=0.5)
    kept = 1.0 - task.filter  # what the filter leaves of it in one step without an action

    def reward(action) -> np.ndarray:
        return np.asarray(natural(SCALE * kept * action[:, LATENT:], LIMIT))

    limp = angles[1:], condition[1:]
    exact = units.first(dataclasses.replace(task, limp_share=0.0), False, *limp)
    assert sums(exact) > LIMIT / kept
    np.testing.assert_array_equal(reward(exact), 0.0)
    for flat in (True, False):
        first = units.first(task, flat, *limp)
        np.testing.assert_allclose(reward(first), 1.0 - kept**2, rtol=1e-5)


def test_without_limp_bodies_starts_on_a_plane_have_no_offsets(units, angles, condition):
    first = units.first(CONFIG.task, True, angles, condition)
    np.testing.assert_array_equal(sums(first), 0.0)
    uneven = units.first(CONFIG.task, False, angles, condition)
    np.testing.assert_allclose(units.target(uneven, condition), angles, atol=1e-5)


def test_offsets_that_do_nothing_are_none(character, angles, condition):
    without = ActionDecoder(untrained_prior(character), 0.0)
    action = np.asarray(without.action(angles, angles, condition))
    np.testing.assert_array_equal(action[:, LATENT:], 0.0)
    assert np.isfinite(action).all()


def test_without_a_prior_the_pose_is_held_whatever_the_sum(character, angles, condition):
    neutral = jnp.asarray(character.neutral_qpos[7:], jnp.float32)
    bare = ActionDecoder(None, SCALE, neutral)
    np.testing.assert_allclose(
        bare.target(bare.hold(angles, condition, 0.1), condition), angles, atol=1e-5
    )
