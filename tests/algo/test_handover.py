"""Hinges with new clips are handed over from the meta policy while few episodes end in falls."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose
from tiny_composite import COMPOSITE, CONFIG, tiny_composite

from getup_jax.config import CompositeConfig, ConfigError
from getup_jax.envs.composite.meta import residual_blending
from getup_jax.envs.composite.meta.chain import with_meta
from getup_jax.evaluation.composite_rollout import without_noise
from getup_jax.physics.character import load_character
from getup_jax.rl.learner import make_learner
from getup_jax.runtime.checkpoint import save_learner

KEY = jax.random.PRNGKey(0)


def test_only_new_hinges_are_blended():
    own, meta = jnp.asarray([[1.0, 2.0]]), jnp.asarray([[5.0, 6.0]])
    new = jnp.asarray([True, False])
    assert_allclose(residual_blending.blended(jnp.asarray(0.25), new, own, meta), [[2.0, 2.0]])
    assert_allclose(residual_blending.blended(jnp.asarray(0.0), new, own, meta), own)


@pytest.mark.parametrize(
    ("share", "falls", "expected"),
    [
        (0.5, 0, 0.5 - 400 * 0.1 / 12_800),
        (0.5, 10, 0.5),  # 40 s of simulated time, a fall every 4 s
        (0.5, 30, 0.5 + 80 / 12_800),
        (0.6, 400, 0.6),  # no more than the first one
        (0.001, 0, 0.0),
    ],
)
def test_the_share_follows_the_falls(share, falls, expected):
    fell = jnp.arange(400) < falls
    assert_allclose(
        residual_blending.followed(jnp.asarray(share), fell, 0.1, 0.6), expected, atol=1e-6
    )


@pytest.fixture(scope="module")
def halved(tmp_path_factory):
    """A task with an untrained meta policy that has half of the arms' targets at first."""
    built = tiny_composite(load_character(CONFIG.physics))
    trained = make_learner(built.environment, CONFIG.network, CONFIG.ppo, total_steps=1000)
    item = {"policy": trained.init_learner(jax.random.PRNGKey(5)).policy, "prior": None}
    folder = tmp_path_factory.mktemp("meta") / "checkpoints"
    meta = str(save_learner(folder, 1, {"none": np.zeros(1)}, CONFIG, item))
    groups = dict(COMPOSITE.groups)
    groups["upper"] = dataclasses.replace(groups["upper"], clips=("aim",))
    composite = dataclasses.replace(COMPOSITE, meta=meta, meta_share=0.5, groups=groups)
    env = dataclasses.replace(built.environment, config=composite)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("getup_jax.envs.composite.meta.chain.load_clips", lambda *_: built.clips)
        return with_meta(
            dataclasses.replace(CONFIG, composite=composite),
            dataclasses.replace(built, environment=env),
        )


def test_a_step_plays_the_blend(halved):
    env, world = halved
    arm, knee = env.task.character.joint("arm_r_abd"), env.task.character.joint("shin_l_flex")
    assert (env.new[arm], env.new[knee]) == (True, False)
    state = env.init(world, KEY, 4)
    meta = state.observation[:, -env.action_size :]
    own = jnp.full_like(meta, 0.3)
    new = jnp.asarray(env.new)
    blend = jnp.where(new, 0.5 * own + 0.5 * meta, own)
    step = jax.jit(env.task.step)
    expected, _ = step(world.task, state.task, blend)
    after, output = jax.jit(env.step)(world, state, own)
    qpos, other = (x.physics.kinematics.qpos for x in (after.task, expected))
    assert_allclose(qpos, other, atol=1e-6)
    alone, _ = step(world.task, state.task, own)
    assert np.abs(np.asarray(qpos - alone.physics.kinematics.qpos)).max() > 1e-4
    assert float(after.share) < 0.5
    assert_allclose(output.metrics["meta_share"], float(after.share))


def test_in_evaluations_all_hinges_are_handed_over(halved):
    env, world = halved
    still = without_noise(env)
    state = still.init(world, KEY, 4)
    assert state.share is None
    own = jnp.full((4, env.action_size), 0.3)
    after, _ = jax.jit(still.advance)(world, state, own)
    expected, _ = jax.jit(env.task.advance)(world.task, state.task, own)
    assert_allclose(after.task.physics.kinematics.qpos, expected.physics.kinematics.qpos, atol=1e-6)


def test_a_share_needs_a_meta_policy():
    with pytest.raises(ConfigError, match=r"composite\.meta_share: .*0 without composite\.meta"):
        CompositeConfig(groups=COMPOSITE.groups, meta_share=0.5)
    with pytest.raises(ConfigError, match=r"composite\.meta_share: .*less than 1"):
        CompositeConfig(groups=COMPOSITE.groups, meta="walk", meta_share=1.0)
