"""Training on irregular ground, over a checkpoint; and without a pose prior."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from ground_samples import TERRAIN
from tiny_task import changed, getups, neutral_prior

from getup_jax.config import NetworkConfig, PPOConfig
from getup_jax.envs.getup.build import assemble
from getup_jax.envs.getup.episode import with_shared
from getup_jax.envs.getup.resets import region_pool
from getup_jax.physics.character import load_character
from getup_jax.pose_prior.prior import to_dict
from getup_jax.rl.learner import make_learner
from getup_jax.runtime import checkpoint
from getup_jax.runtime.pytree_store import CheckpointError, to_nested

PPO = PPOConfig(num_envs=8, num_steps=3, epochs=1, minibatch_size=24)
SETTINGS = changed(pool_size=96, prioritisation=0.5)


def build(config, prior: bool = True):
    character = load_character(config.physics)
    vae = neutral_prior(character) if prior else None
    task = assemble(config, character, getups(character), vae, lambda text: None)
    return task, make_learner(task.environment, NetworkConfig((8,)), PPO, total_steps=1000)


def test_a_resumed_run_keeps_the_curriculum_and_goes_on_bit_for_bit(tmp_path, monkeypatch):
    monkeypatch.setattr(region_pool, "cache_dir", lambda: tmp_path)
    terrain = dataclasses.replace(TERRAIN, curriculum="schedule", schedule_steps=32)
    config = dataclasses.replace(SETTINGS, terrain=terrain)
    task, learner = build(config)
    begin, iterate = jax.jit(learner.init), jax.jit(learner.iteration)
    state, metrics = iterate(task.world, begin(task.world, jax.random.PRNGKey(0)))
    assert float(metrics["rollout/regions_open"]) == 1.0
    halfway = state.environment.curriculum.regions
    assert (int(halfway.steps), int(halfway.opened)) == (3, 1)
    item = {"policy": state.learner.policy, "prior": to_dict(task.prior)}
    checkpoint.save_learner(tmp_path / "run", 1, state, config, item, {"steps": 24})
    template = begin(task.world, jax.random.PRNGKey(1))
    restored = checkpoint.restore_learner(tmp_path / "run", template).state
    for _ in range(2):
        state, _ = iterate(task.world, state)
        restored, metrics = iterate(task.world, restored)
    same = jax.tree.map(lambda a, b: np.array_equal(a, b), state, restored)
    assert jax.tree.all(same)
    # the second region opened after four steps of the batch, the third after eight
    assert int(restored.environment.curriculum.regions.opened) == 3
    assert float(metrics["rollout/regions_open"]) == pytest.approx((2 + 3 + 3) / 3)


def test_another_batch_takes_over_the_curriculum_and_what_is_learned(tmp_path, monkeypatch):
    monkeypatch.setattr(region_pool, "cache_dir", lambda: tmp_path)
    config = dataclasses.replace(SETTINGS, terrain=TERRAIN)
    task, _ = build(config)
    begin = jax.jit(task.environment.init, static_argnums=2)
    eight = begin(task.world, jax.random.PRNGKey(0), 8)
    learned = eight.curriculum
    learned = learned.replace(
        success=learned.success + 0.25, regions=learned.regions.replace(opened=jnp.asarray(3))
    )
    eight = eight.replace(curriculum=learned)
    four = begin(task.world, jax.random.PRNGKey(0), 4)
    taken = with_shared(four, to_nested(eight), "run")
    assert int(taken.curriculum.regions.opened) == 3
    np.testing.assert_array_equal(taken.curriculum.success, learned.success)
    assert taken.time.shape == (4,)
    other = four.replace(curriculum=four.curriculum.replace(success=None))
    with pytest.raises(CheckpointError, match=r"run: the array success"):
        with_shared(other, to_nested(eight), "run")


@pytest.mark.slow
def test_without_a_pose_prior_the_action_is_the_servo_target():
    config = changed(SETTINGS, offset_scale=0.5)
    task, learner = build(config, prior=False)
    env, world = task.environment, task.world
    assert (env.action_size, env.observation_size) == (49, 352 - 16)
    start = jax.jit(env.start)(world, *jnp.zeros((3, 4), jnp.int32))
    target = np.asarray(env.servo_target(world, start, start.action))
    pose = np.asarray(start.physics.kinematics.qpos)[:, 7:]
    limited = np.clip(pose, world.target_lower, world.target_upper)
    np.testing.assert_allclose(target, limited, atol=1e-5)
    moved = np.asarray(env.servo_target(world, start, jnp.zeros((4, 49)).at[:, 3].set(0.2)))
    neutral = env.character.neutral_qpos[7:].astype(np.float32)
    np.testing.assert_allclose(moved[0] - neutral, np.eye(49)[3] * 0.1, atol=1e-6)
    state = jax.jit(learner.init)(world, jax.random.PRNGKey(0))
    state, metrics = jax.jit(learner.iteration)(world, state)
    assert float(metrics["rollout/reward_total"]) == float(metrics["rollout/reward_task"])
    assert "rollout/reward_natural" not in metrics
    assert np.isfinite(np.asarray(state.environment.observation)).all()
