"""The way through Gymnasium, with the real library."""

from __future__ import annotations

import numpy as np
import pytest

import getup_jax as gj
from getup_jax.config import ConfigError
from gym_samples import noise, small

gymnasium = pytest.importorskip("gymnasium")
SIZE, STEPS = 6, 75


@pytest.fixture(scope="module")
def envs():
    made = gymnasium.make_vec("getup_jax.gym:GetUp-v0", num_envs=SIZE, config=small())
    yield made
    made.close()


@pytest.fixture(scope="module")
def run(envs):
    """What `step` gave, from a seed and the same actions as in `reference`."""
    first, _ = envs.reset(seed=5)
    return first, [envs.step(noise(envs.action_space.shape, step)) for step in range(STEPS)]


def test_spaces_and_metadata_are_what_gymnasium_asks_for(envs, run):
    assert envs.metadata["autoreset_mode"] is gymnasium.vector.AutoresetMode.SAME_STEP
    assert envs.observation_space.contains(run[0])
    assert envs.action_space.sample().shape == (SIZE, envs.single_action_space.shape[0])
    assert envs.spec.id == "GetUp-v0"
    observation, reward, terminated, truncated, _ = run[1][0]
    assert envs.observation_space.contains(observation)
    assert (reward.shape, reward.dtype) == ((SIZE,), np.float64)
    assert terminated.dtype == truncated.dtype == np.bool_


def test_the_numbers_are_those_of_the_environment_itself(envs, run):
    inner = envs.unwrapped.env
    rng = np.random.default_rng(np.random.SeedSequence(5))
    state = inner.reset(int(rng.integers(2**31)))
    assert np.array_equal(run[0], state.observation)
    ends = 0
    for step, (observation, reward, terminated, _, infos) in enumerate(run[1]):
        state, output = inner.step(state, noise(envs.action_space.shape, step))
        done = np.asarray(output.done)
        assert np.array_equal(observation, output.observation)
        np.testing.assert_allclose(reward, output.reward[:, 0], rtol=1e-6)
        assert np.array_equal(terminated, output.terminated)
        for index in np.flatnonzero(done):
            ends += 1
            assert np.array_equal(infos["final_obs"][index], output.final_observation[index])
            assert not np.array_equal(infos["final_obs"][index], observation[index])
            verdict = infos["final_info"]["return_rate"][index]
            assert verdict == np.asarray(output.episode["return_rate"])[index]
    assert ends >= SIZE


def test_infos_have_the_masks_of_gymnasium(run):
    for *_, terminated, truncated, infos in run[1]:
        done = terminated | truncated
        assert np.array_equal(infos["_reward_total"], ~done)
        assert ("final_obs" in infos) == done.any()
        if done.any():
            assert np.array_equal(infos["_final_obs"], done)
            assert [x is not None for x in infos["final_obs"]] == done.tolist()
            assert np.array_equal(infos["final_info"]["_return_rate"], done)


def test_seeds(envs):
    first, _ = envs.reset(seed=1)
    again, _ = envs.reset(seed=1)
    other, _ = envs.reset(seed=2)
    following, _ = envs.reset()
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)
    assert not np.array_equal(other, following)


def test_gymnasiums_wrapper_counts_the_episodes(envs, run):
    wrapped = gymnasium.wrappers.vector.RecordEpisodeStatistics(envs)
    wrapped.reset(seed=5)
    ended = 0
    for step in range(STEPS):
        *_, terminated, truncated, infos = wrapped.step(noise(envs.action_space.shape, step))
        assert np.array_equal(terminated, run[1][step][2])
        done = terminated | truncated
        if done.any():
            ended += done.sum()
            assert (infos["episode"]["l"][done] > 1).all()
    assert wrapped.episode_count == ended >= SIZE


def test_pictures_of_every_episode(envs):
    envs.reset(seed=0)
    assert envs.render() is None
    envs.unwrapped.render_mode = "rgb_array"
    pictures = envs.render()
    envs.unwrapped.render_mode = None
    assert len(pictures) == SIZE
    assert pictures[0].shape == (480, 640, 3)
    assert not np.array_equal(pictures[0], pictures[1])


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"config": "quikc"}, "quikc"),
        ({"render_mode": "human"}, "render_mode: expected None or 'rgb_array', got 'human'"),
        ({"training": True, "scenario": gj.Scenario()}, "a scenario or training=True, got both"),
        ({"num_envs": 0}, "num_envs: expected a whole number of at least 1, got 0"),
        ({"num_envs": 2.5}, "num_envs: expected a whole number of at least 1, got 2.5"),
        ({"config": 3}, "config: expected a config, a policy, or a name, got 3"),
        ({"scenario": 3}, "scenario: expected a getup_jax.Scenario, got 3"),
        ({"training": "yes"}, "training: expected True or False, got 'yes'"),
    ],
)
def test_what_is_not_possible_is_one_line(options, text):
    with pytest.raises(ConfigError, match=text) as raised:
        gymnasium.make_vec("getup_jax.gym:GetUp-v0", **{"num_envs": 2, **options})
    assert "\n" not in str(raised.value)


def test_wrong_calls_are_one_line(envs):
    envs.reset(seed=0)
    with pytest.raises(ConfigError, match=r"actions: expected an array of shape \(6, 65\)"):
        envs.step(np.zeros((6, 3)))
    with pytest.raises(ConfigError, match="actions: expected an array of numbers of shape"):
        envs.step("x")
    actions = np.zeros(envs.action_space.shape)
    actions[2, 7] = np.nan
    with pytest.raises(ConfigError, match=r"finite numbers, got nan at \(2, 7\) \(1 of 390\)"):
        envs.step(actions)
    with pytest.raises(ConfigError, match="seed: expected one number"):
        envs.reset(seed=[1] * SIZE)
    with pytest.raises(ConfigError, match="options: expected none, got reset_mask"):
        envs.reset(options={"reset_mask": np.ones(SIZE, bool)})
