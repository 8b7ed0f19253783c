from __future__ import annotations

import numpy as np
import pytest

from getup_jax.rl.gae import gae

T, B, K = 12, 5, 3
NEVER = np.zeros((T, B), bool)


def _data(seed: int = 0):
    rng = np.random.default_rng(seed)
    reward, value, next_value = rng.normal(size=(3, T, B, K)).astype(np.float32)
    terminated, truncated = rng.random((2, T, B)) < 0.2
    return reward, value, next_value, terminated, truncated


def _slow(reward, value, next_value, terminated, truncated, discount, gae_lambda):
    """Every advantage as its own sum over the rest of its episode, in float64."""
    advantage = np.zeros(reward.shape)
    for index in np.ndindex(reward.shape):
        t, b, *k = index
        factor = 1.0
        for s in range(t, T):
            at = (s, b, *k)
            goes_on = 0.0 if terminated[s, b] else 1.0
            delta = reward[at] + discount * goes_on * float(next_value[at]) - value[at]
            advantage[index] += factor * delta
            factor *= discount * gae_lambda
            if terminated[s, b] or truncated[s, b]:
                break
    return advantage


def test_three_steps_by_hand():
    reward = np.asarray([[1.0], [2.0], [4.0]], np.float32)
    value = np.asarray([[0.5], [1.0], [2.0]], np.float32)
    next_value = np.asarray([[1.0], [2.0], [8.0]], np.float32)
    no = np.zeros((3, 1), bool)
    # delta = 1 + .5*1 - .5 = 1;  2 + .5*2 - 1 = 2;  4 + .5*8 - 2 = 6;  trace factor .5*.5 = .25
    advantage, target = gae(reward, value, next_value, no, no, 0.5, 0.5)
    np.testing.assert_allclose(advantage, [[1.875], [3.5], [6.0]])
    np.testing.assert_allclose(target, [[2.375], [4.5], [8.0]])


def test_termination_and_truncation_by_hand():
    reward = np.ones((2, 3), np.float32)
    value = np.zeros((2, 3), np.float32)
    next_value = np.full((2, 3), 10.0, np.float32)
    terminated = np.asarray([[True, False, True], [False] * 3])
    truncated = np.asarray([[False, True, True], [False] * 3])
    advantage, _ = gae(reward, value, next_value, terminated, truncated, 0.5, 1.0)
    # Termination: the reward alone, also when both; truncation: with the value, without the trace.
    np.testing.assert_allclose(advantage[0], [1.0, 6.0, 1.0])
    np.testing.assert_allclose(advantage[1], 6.0)


@pytest.mark.parametrize("gae_lambda", [0.0, 0.7, 1.0])
def test_matches_slow_reference(gae_lambda: float):
    data = _data()
    advantage, target = gae(*data, 0.9, gae_lambda)
    np.testing.assert_allclose(advantage, _slow(*data, 0.9, gae_lambda), atol=1e-5)
    np.testing.assert_allclose(target, advantage + data[1], atol=1e-6)


def test_objectives_are_independent():
    reward, value, next_value, *ends = _data()
    together, _ = gae(reward, value, next_value, *ends, 0.9, 0.95)
    for k in range(K):
        alone, _ = gae(reward[..., k], value[..., k], next_value[..., k], *ends, 0.9, 0.95)
        np.testing.assert_allclose(together[..., k], alone, atol=1e-6)


def test_lambda_one_is_monte_carlo_minus_value():
    reward, value, *_ = _data()
    # Consistent values, as a rollout without resets has them, telescope away.
    last = np.ones((1, B, K), np.float32)
    next_value = np.concatenate([value[1:], last])
    advantage, target = gae(reward, value, next_value, NEVER, NEVER, 0.9, 1.0)
    returns = np.zeros((T, B, K))
    following = last[0].astype(float)
    for t in reversed(range(T)):
        returns[t] = following = reward[t] + 0.9 * following
    np.testing.assert_allclose(target, returns, atol=1e-5)
    np.testing.assert_allclose(advantage, returns - value, atol=1e-5)


def test_value_after_a_termination_is_not_read():
    reward, value, next_value, terminated, truncated = _data()
    expected, _ = gae(reward, value, next_value, terminated, truncated, 0.9, 0.95)
    broken = np.where(terminated[..., None], np.nan, next_value)
    found, _ = gae(reward, value, broken, terminated, truncated, 0.9, 0.95)
    np.testing.assert_array_equal(found, expected)


def test_every_objective_may_have_a_discount_of_its_own():
    data, discounts = _data(), (0.9, 0.5, 0.99)
    advantage, target = gae(*data, np.asarray(discounts, np.float32), 0.7)
    for k, discount in enumerate(discounts):
        alone, alone_target = gae(*(x[..., k] if x.ndim == 3 else x for x in data), discount, 0.7)
        np.testing.assert_allclose(advantage[..., k], alone, rtol=1e-5, atol=1e-6)
        np.testing.assert_allclose(target[..., k], alone_target, rtol=1e-5, atol=1e-6)
