"""The task in NumPy, that peers train on, and ours are one task."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tiny_task import CONFIG, getups, untrained_prior

from getup_jax.config import ConfigError
from getup_jax.envs.getup.build import assemble
from getup_jax.envs.getup.episode import STANDING
from getup_jax.physics.character import load_character

pytest.importorskip("gymnasium")
from support.numpy_task import NumpyGetUp
from support.task_file import write_task

CONFIG_HERE = dataclasses.replace(
    CONFIG,
    task=dataclasses.replace(CONFIG.task, stand_start=1.0, stand_time_s=1.5, offset_scale=0.25),
    curriculum=None,
)


@pytest.fixture(scope="module")
def built():
    character = load_character(CONFIG_HERE.physics)
    prior = untrained_prior(character, mirrored=True)
    return assemble(CONFIG_HERE, character, getups(character), prior, lambda _: None)


@pytest.fixture(scope="module")
def env(built, tmp_path_factory) -> NumpyGetUp:
    folder = tmp_path_factory.mktemp("task")
    write_task(folder, built, CONFIG_HERE)
    return NumpyGetUp(folder)


def test_an_episode_is_the_same_in_both(built, env):
    """Of random actions, from the first start to the fall and its early end."""
    task, world = built.environment, built.world
    one = jnp.zeros(1, jnp.int32)
    state = jax.jit(task.start)(world, one, one + STANDING, one)
    advance, rng = jax.jit(task.advance), np.random.default_rng(0)
    env.start(0)
    for step in range(60):
        action = (0.3 * rng.normal(size=env.action_space.shape)).astype(np.float32)
        state, output = advance(world, state, action[None])
        observation, reward, terminated, truncated, info = env.step(action)
        np.testing.assert_allclose(observation, output.observation[0], atol=2e-3, err_msg=str(step))
        assert reward == pytest.approx(float(output.reward[0, 0]), abs=1e-3)
        assert (terminated, truncated) == (bool(output.terminated[0]), bool(output.truncated[0]))
        if terminated or truncated:
            assert info["is_success"] == bool(output.episode["stand_success"][0])
            break
    assert terminated or truncated
    assert step > 10


def test_resets_draw_from_all_starts_and_the_seed_says_which(env):
    first = [env.reset(seed=seed)[0] for seed in (1, 2, 1)]
    assert np.array_equal(first[0], first[2])
    assert not np.array_equal(first[0], first[1])
    assert env.observation_space.contains(first[0])


def test_a_task_without_a_prior_is_refused(built, tmp_path):
    with pytest.raises(ConfigError, match="expected a config with a pose prior"):
        write_task(tmp_path, dataclasses.replace(built, prior=None), CONFIG_HERE)
