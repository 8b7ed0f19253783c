"""Every id that is registered is an environment, through the real library."""

from __future__ import annotations

import numpy as np
import pytest

import getup_jax as gj
from gym_samples import noise

gymnasium = pytest.importorskip("gymnasium")
SIZE = 2
# what makes each of them small; the rest is that of its default config
SMALL = {
    "GetUp-Terrain-v0": ("terrain", "task.pool_size=64", "terrain.drops=300", "task.limp_drops=64"),
    "CompositeWalk-v0": ("composite_walk_location", "task.pool_size=8"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SMALL)
def test_the_other_ids_are_built_and_stepped(name):
    from getup_jax.gym import ENVIRONMENTS

    config = gj.load_config(*SMALL[name])
    assert SMALL[name][0] == ENVIRONMENTS[name]
    envs = gymnasium.make_vec(f"getup_jax.gym:{name}", num_envs=SIZE, config=config)
    first, _ = envs.reset(seed=3)
    assert envs.observation_space.contains(first)
    earned, ended = np.zeros(SIZE), 0
    for step in range(60):
        observation, reward, terminated, truncated, infos = envs.step(
            noise(envs.action_space.shape, step)
        )
        done = terminated | truncated
        assert envs.observation_space.contains(observation)
        assert np.isfinite(reward).all()
        assert ("final_obs" in infos) == done.any()
        # a fall costs, in composite motion more than is earned before it
        earned, ended = earned + np.where(terminated, 0.0, reward), ended + done.sum()
    assert (earned > 0).all()
    assert ended > 0  # of random actions a body falls within two seconds
    again, _ = envs.reset(seed=3)
    assert np.array_equal(first, again)
    envs.close()
