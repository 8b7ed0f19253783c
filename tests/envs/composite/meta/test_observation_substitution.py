"""A meta policy sees the links that it has lost as its own clips have them."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose
from tiny_composite import COMPOSITE, CONFIG, tiny_composite

from compiled import first_policy
from getup_jax.config import CompositeConfig, ConfigError
from getup_jax.core import quaternion
from getup_jax.envs.composite.meta.chain import with_meta
from getup_jax.envs.composite.meta.observation_substitution import make_substitution, substitute
from getup_jax.physics.character import load_character
from getup_jax.rl.learner import make_learner
from getup_jax.runtime.checkpoint import save_learner

KEY = jax.random.PRNGKey(0)


@pytest.fixture(scope="module")
def built():
    return tiny_composite(load_character(CONFIG.physics))


@pytest.fixture(scope="module")
def arm(built):
    names = built.environment.character.link_names
    return np.array([name.startswith(("arm_r", "forearm_r", "hand_r")) for name in names])


def moved(history: np.ndarray, yaw: float, offset: np.ndarray) -> np.ndarray:
    """The same motion elsewhere: turned about the vertical and shifted."""
    turn = quaternion.about_z(jnp.asarray(yaw))
    blocks = [
        quaternion.rotate(turn, jnp.asarray(history[..., :3])) + offset,
        quaternion.multiply(jnp.broadcast_to(turn, history[..., 3:7].shape), history[..., 3:7]),
        quaternion.rotate(turn, jnp.asarray(history[..., 7:10])),
        quaternion.rotate(turn, jnp.asarray(history[..., 10:])),
    ]
    return np.concatenate(blocks, axis=-1)


def test_what_it_knows_it_sees_as_it_is(built, arm):
    history = np.asarray(built.world.starts.history)
    known = make_substitution(history, arm)
    elsewhere = moved(history[:5], 2.0, np.array([3.0, -1.0, 0.0]))
    seen = np.asarray(substitute(known, jnp.asarray(elsewhere)))
    np.testing.assert_array_equal(seen[:, :, ~arm], elsewhere[:, :, ~arm])
    assert_allclose(seen, elsewhere, atol=1e-4)


def test_another_arm_is_shown_where_its_clip_has_it(built, arm):
    """Whatever the arm does, and with legs that are a little off."""
    rng = np.random.default_rng(0)
    history = np.asarray(built.world.starts.history)
    known = make_substitution(history, arm)
    elsewhere = moved(history[:5], -1.0, np.array([0.0, 2.0, 0.0]))
    other = elsewhere.copy()
    other[:, :, arm] += rng.normal(0.0, 0.5, other[:, :, arm].shape)
    other[:, :, 1:, :3] += rng.normal(0.0, 1e-4, other[:, :, 1:, :3].shape)
    seen = np.asarray(substitute(known, jnp.asarray(other, jnp.float32)))
    assert_allclose(seen[:, :, arm], elsewhere[:, :, arm], atol=1e-3)
    assert_allclose(seen[:, :, ~arm], other[:, :, ~arm], atol=1e-6)


def test_the_root_is_always_where_it_is(built):
    history = jnp.asarray(built.world.starts.history[:3])
    everything = np.ones(history.shape[2], bool)
    seen = substitute(make_substitution(history, everything), history)
    assert_allclose(seen[:, :, 0], history[:, :, 0])


def test_a_meta_policy_acts_as_if_the_arm_were_its_own(built, arm, tmp_path, monkeypatch):
    monkeypatch.setattr("getup_jax.envs.composite.meta.chain.load_clips", lambda *_: built.clips)
    trained = make_learner(built.environment, CONFIG.network, CONFIG.ppo, total_steps=1000)
    item = {"policy": first_policy(trained, seed=5), "prior": None}
    meta = str(save_learner(tmp_path / "checkpoints", 1, {"none": np.zeros(1)}, CONFIG, item))
    groups = dict(COMPOSITE.groups)
    groups["upper"] = dataclasses.replace(groups["upper"], clips=("aim",))
    actions = {}
    for sees in ("all", "own"):
        composite = dataclasses.replace(COMPOSITE, meta=meta, meta_sees=sees, groups=groups)
        env = dataclasses.replace(built.environment, config=composite)
        task, world = with_meta(
            dataclasses.replace(CONFIG, composite=composite),
            dataclasses.replace(built, environment=env),
        )
        task = dataclasses.replace(task, sample=False)
        start = env.start(built.world, jnp.arange(4), KEY)
        for held in (False, True):
            history = start.history
            if held:
                history = history.at[:, :, jnp.asarray(arm), :3].add(0.3)
            observation = env.observe(history, start.goals, start.physics)
            state = start.replace(history=history, observation=observation)
            joined = task.adopt(world, state, state.goals, KEY).observation
            # the new policy sees the arm where it is
            assert_allclose(joined[:, : env.observation_size], observation)
            actions[sees, held] = np.asarray(joined[:, env.observation_size :])
    change = {
        sees: np.abs(actions[sees, True] - actions[sees, False]).max() for sees in ("all", "own")
    }
    assert change["own"] < 0.05 * change["all"]


def test_what_it_sees_is_one_of_two():
    with pytest.raises(
        ConfigError, match=r"composite\.meta_sees: expected one of \('all', 'own'\)"
    ):
        CompositeConfig(groups=COMPOSITE.groups, meta_sees="none")
