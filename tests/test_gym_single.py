"""One episode at a time passes Gymnasium's own checker."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from gym_samples import noise, small

gymnasium = pytest.importorskip("gymnasium")


@pytest.fixture(scope="module")
def env():
    made = gymnasium.make("getup_jax.gym:GetUp-v0", config=small())
    yield made
    made.close()


def test_the_checker_of_gymnasium_passes(env):
    from gymnasium.utils.env_checker import check_env

    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        # what it would make anew for pictures and for `close` is tested below and elsewhere
        check_env(env.unwrapped, skip_render_check=True, skip_close_check=True)
    texts = [str(w.message) for w in found]
    # observations are in SI units; actions are in standard deviations of poses
    assert [t for t in texts if "infinity" not in t and "symmetric and normalized" not in t] == []


def test_an_episode_ends_once(env):
    env.reset(seed=3)
    for step in range(300):
        observation, reward, terminated, truncated, info = env.step(
            noise(env.action_space.shape, step)
        )
        assert 0 <= reward <= 1
        if terminated or truncated:
            break
    assert terminated
    assert not truncated
    assert 0 < info["return_rate"] < 1
    assert observation.shape == env.observation_space.shape
    assert env.render() is None
    again, _ = env.reset(seed=3)
    assert not np.array_equal(again, observation)
    with pytest.raises(gymnasium.error.ResetNeeded):
        type(env.unwrapped).step(_fresh(env.unwrapped), np.zeros(env.action_space.shape))


def _fresh(env):
    """An environment that was not reset."""
    import copy

    made = copy.copy(env)
    made._state = None
    return made


def test_pictures(env):
    env.reset(seed=0)
    env.unwrapped.render_mode = "rgb_array"
    picture = env.unwrapped.render()
    env.unwrapped.render_mode = None
    assert picture.shape == (480, 640, 3)
    assert picture.std() > 10
    env.unwrapped.close()
    env.unwrapped.close()


def test_a_missing_gymnasium_is_one_line(monkeypatch):
    import importlib
    import sys

    monkeypatch.setitem(sys.modules, "gymnasium", None)
    with pytest.raises(ImportError, match=r"pip install 'getup-jax\[gym\]'"):
        importlib.reload(sys.modules["getup_jax.gym"])
