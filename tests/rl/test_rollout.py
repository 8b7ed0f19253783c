from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from getup_jax.rl.rollout import Rollout, masked_mean, rollout, summarize
from probes import Probe, make_world

T, B = 7, 6


def _policy(observation: jax.Array, key: jax.Array):
    action = 10.0 * observation[:, :1] + jax.random.uniform(key, (B, 1))
    return action, action[:, 0] + 1.0


@pytest.fixture(scope="module")
def collected() -> Rollout:
    world = make_world(length=3, truncates=True, constant=1.0, shows_step=1.0)
    env = Probe(scale=(1.0, -2.0))

    def collect(world, key):
        return rollout(env, world, env.init(world, key, B), _policy, jax.random.fold_in(key, 1), T)

    return jax.jit(collect)(world, jax.random.key(0))


def test_rows_belong_together(collected: Rollout):
    x = collected.transition
    assert x.reward.shape == (T, B, 2)
    assert_array_equal(x.observation[:, 0, 0], [0, 1, 2, 0, 1, 2, 0])
    assert_array_equal(x.action[:, :, 0] // 10, x.observation[:, :, 0])
    assert_array_equal(x.log_prob, x.action[:, :, 0] + 1.0)
    assert_array_equal(x.reward[0, 0], [1.0, -2.0])
    assert_array_equal(x.extras["step"], x.final_observation[:, :, 0])


def test_final_observation_is_from_before_the_reset(collected: Rollout):
    x = collected.transition
    assert_array_equal(x.final_observation[:, 0, 0], [1, 2, 3, 1, 2, 3, 1])
    assert_array_equal(x.truncated[:, 0], [False, False, True] * 2 + [False])
    assert not x.terminated.any()
    going = ~np.asarray(x.truncated[:-1])
    assert_array_equal(x.final_observation[:-1][going], x.observation[1:][going])


def test_state_continues_after_the_last_row(collected: Rollout):
    assert_array_equal(collected.environment.step, 1)


def test_noise_differs_from_step_to_step(collected: Rollout):
    noise = np.asarray(collected.transition.action[:, :, 0]) % 10
    assert len(np.unique(noise.round(6))) == T * B


def test_summary_averages_ended_episodes(collected: Rollout):
    metrics = jax.jit(summarize)(collected)
    assert all(x.dtype == jnp.float32 and x.shape == () for x in metrics.values())
    assert_allclose(metrics["rollout/reward"], 1.0)
    assert_allclose(metrics["episode/count"], 2 * B)
    assert_allclose(metrics["episode/steps"], 3.0)
    assert_allclose(metrics["episode/terminated_share"], 0.0)
    # NaN for the episodes with a negative sign, 1 for the others.
    assert_allclose(metrics["episode/plus"], 1.0)


def test_masked_mean_by_hand():
    x = jnp.asarray([1.0, jnp.nan, 5.0])
    assert_allclose(masked_mean(x, jnp.asarray([True, False, True])), 3.0)
    assert np.isnan(masked_mean(x, jnp.zeros(3, bool)))


def test_an_environment_of_other_shapes_is_told_as_it_is_traced():
    class Odd(Probe):
        def step(self, world, state, action):
            after, output = super().step(world, state, action)
            return after, output.replace(metrics={"one": jnp.zeros(())})

    world, key = make_world(), jax.random.PRNGKey(0)
    state = Odd().init(world, key, 4)

    def policy(observation, key_action):
        return jnp.zeros((4, Odd().action_size)), jnp.zeros(4)

    with pytest.raises(AssertionError, match="assert_shape failed"):
        rollout(Odd(), world, state, policy, key, 2)
