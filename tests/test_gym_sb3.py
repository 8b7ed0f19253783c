"""The way through stable-baselines3, with the real library."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from gym_samples import noise, small

sb3 = pytest.importorskip("stable_baselines3")
SIZE = 6


@pytest.fixture(scope="module")
def env():
    import getup_jax.gym

    made = getup_jax.gym.sb3_env(small(), num_envs=SIZE)
    yield made
    made.close()


def test_ends_of_episodes_are_told_as_sb3_wants_them(env):
    env.seed(4)
    first = env.reset()
    assert first.shape == (SIZE, *env.observation_space.shape)
    ended = 0
    for step in range(45):
        observation, reward, done, infos = env.step(noise((SIZE, *env.action_space.shape), step))
        assert reward.dtype == np.float32
        for index, info in enumerate(infos):
            assert bool(info) == done[index]
            if info:
                ended += 1
                assert not np.array_equal(info["terminal_observation"], observation[index])
                assert info["TimeLimit.truncated"] is False
                assert info["is_success"] == 0.0
    assert ended >= SIZE
    env.seed(4)
    assert np.array_equal(env.reset(), first)


def test_ppo_of_sb3_learns_from_it(env):
    from stable_baselines3.common.vec_env import VecMonitor

    model = sb3.PPO("MlpPolicy", VecMonitor(env), n_steps=16, batch_size=48, n_epochs=1, seed=0)
    before = [x.detach().clone() for x in model.policy.parameters()]
    model.learn(2 * 16 * SIZE)
    assert model.num_timesteps == 2 * 16 * SIZE
    after = list(model.policy.parameters())
    assert any(not np.array_equal(a, b.detach()) for a, b in zip(before, after, strict=True))
    assert len(model.ep_info_buffer) > 0


def test_what_single_episodes_cannot_do_is_one_line(env):
    from getup_jax.config import ConfigError

    assert env.get_attr("num_envs") == [SIZE] * SIZE
    assert env.env_is_wrapped(sb3.common.monitor.Monitor) == [False] * SIZE
    with pytest.raises(ConfigError, match="cannot be set"):
        env.set_attr("num_envs", 2)
    with pytest.raises(ConfigError, match="cannot be called of single episodes"):
        env.env_method("reset")


def test_a_process_that_would_crash_is_told_so(monkeypatch, tmp_path):
    import getup_jax.gym
    from getup_jax.config import ConfigError

    pytest.importorskip("triton")
    loaded = tmp_path / "maps"
    loaded.write_text("7f00-7f01 r-xp 00000000 fe:00 1 /usr/lib/libLLVM-15.so.1\n")
    monkeypatch.setattr(getup_jax.gym, "_LOADED", loaded)
    monkeypatch.delitem(sys.modules, "triton")
    with pytest.raises(ConfigError, match="pictures were rendered before"):
        getup_jax.gym.sb3_env("quick")
