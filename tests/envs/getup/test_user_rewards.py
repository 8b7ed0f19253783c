"""Reward terms of users are factors of the reward, by name."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tiny_task import CONFIG, changed, tiny_task

import getup_jax as gj
from getup_jax.config import ConfigError
from getup_jax.envs.getup.build import build_task
from getup_jax.envs.getup.episode import LYING
from getup_jax.envs.getup.user_rewards import REWARDS, RewardInputs


@pytest.fixture(autouse=True)
def registered(monkeypatch):
    """The terms of this file, gone after each test."""
    monkeypatch.setattr(REWARDS, "_found", dict(REWARDS))

    @gj.register_reward("low_pelvis")
    def low_pelvis(step: RewardInputs) -> jax.Array:
        return jnp.exp(-step.kinematics.qpos[:, 2])

    @gj.register_reward("one_number")
    def one_number(step: RewardInputs) -> jax.Array:
        return jnp.mean(step.phase)

    @gj.register_reward("broken")
    def broken(step: RewardInputs) -> jax.Array:
        return step.kinematics["qpos"]  # type: ignore[index]


def one_step(built):
    env, rows = built.environment, jnp.arange(4)
    state = env.start(built.world, rows % 2, jnp.full(4, LYING), rows)
    return jax.jit(env.advance)(built.world, state, state.action)


def test_a_term_is_a_factor_with_its_exponent(character, built):
    config = changed(rewards={"low_pelvis": 2.0})
    (_, plain), (state, output) = one_step(built), one_step(tiny_task(character, config))
    expected = np.exp(-2.0 * np.asarray(state.physics.kinematics.qpos[:, 2]))
    np.testing.assert_allclose(output.terms["low_pelvis"], expected, rtol=1e-5)
    np.testing.assert_allclose(output.reward[:, 0], plain.reward[:, 0] * expected, rtol=1e-5)
    np.testing.assert_array_equal(output.terms["task"], plain.terms["task"])
    assert "reward_low_pelvis" in output.logged


def test_it_can_have_a_critic_of_its_own(character):
    config = changed(rewards={"low_pelvis": 1.0}, objectives="terms")
    env = tiny_task(character, config).environment
    assert list(env.objective_weights)[-1] == "low_pelvis"


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("low_pelvi", r"task\.rewards: unknown 'low_pelvi'; did you mean 'low_pelvis'\?"),
        ("height", r"task\.rewards: 'height' is a term of the task; choose another name"),
    ],
)
def test_names_are_checked_before_anything_is_built(name, message):
    logged: list[str] = []
    with pytest.raises(ConfigError, match=message):
        build_task(changed(rewards={name: 1.0}), logged.append)
    assert not logged


def test_a_term_of_another_shape_says_so(character):
    built = tiny_task(character, changed(rewards={"one_number": 1.0}))
    with pytest.raises(ConfigError, match=r"one_number: expected .* shape \(4,\), got \(\)"):
        one_step(built)


def test_what_a_term_raises_is_a_line_with_its_place(character):
    built = tiny_task(character, changed(rewards={"broken": 1.0}))
    said = r"task\.rewards\.broken: raised TypeError: .* \(test_user_rewards\.py, line \d+\)"
    with pytest.raises(ConfigError, match=said):
        one_step(built)


def test_a_config_has_none_by_default():
    assert CONFIG.task.rewards == {}
    with pytest.raises(ConfigError, match=r"task\.rewards\.x: expected a number more than 0"):
        changed(rewards={"x": 0.0})
