"""The actor of composite motion learns what comes next in the clips."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tiny_composite import COMPOSITE, CONFIG, clips, tiny_composite

from compiled import first_policy
from getup_jax.envs.composite.meta.chain import with_meta
from getup_jax.envs.composite.reference_state_init import FOLLOWING, Following, reference_states
from getup_jax.imitation import dagger
from getup_jax.motion.authoring.loops import repeated
from getup_jax.physics.character import load_character
from getup_jax.rl.learner import make_learner
from getup_jax.runtime.checkpoint import save_learner

KEY = jax.random.PRNGKey(0)


@pytest.fixture(scope="module")
def built():
    return tiny_composite(load_character(CONFIG.physics))


def test_what_follows_a_start_is_its_clip(built):
    character = built.environment.character
    squat = clips(character)["lower"][0]
    knee = character.joint("shin_l_flex")
    following = built.following.angles[:, 0, :, knee]
    starts = np.asarray(built.world.starts.physics.kinematics.qpos)[:, 7 + knee]
    assert following.shape == (len(starts), FOLLOWING)
    # the clip is a loop that is played twice: each frame but the last ones has a next one
    angles = squat.qpos[:, 7 + knee]
    frame = np.abs(angles[None, :-1] - starts[:, None]).argmin(axis=1)
    reached = np.isfinite(following[:, 0])
    up_or_down = np.minimum(
        np.abs(following[:, 0] - angles[frame + 1]), np.abs(following[:, 0] - angles[frame - 1])
    )
    np.testing.assert_allclose(up_or_down[reached], 0.0, atol=1e-3)
    past = np.isnan(following).sum(axis=1)
    assert past[0] == 0
    assert past[-1] == FOLLOWING


def test_targets_lead_by_the_lag_of_the_servo(built):
    model = built.environment.character.model
    joints = built.following.angles.shape[-1]
    ramp = np.broadcast_to(np.arange(FOLLOWING, dtype=float)[:, None], (FOLLOWING, joints)) * 0.01
    made = dataclasses.replace(built, following=Following(ramp[None, None], np.zeros(1)))
    lag = -model.actuator_biasprm[:, 2] / model.actuator_gainprm[:, 0]
    expected = ramp[:-1] + lag * 0.01 * 30.0  # rad + s * rad/s
    np.testing.assert_allclose(dagger.clip_targets(made)[0, 0], expected, atol=1e-9)


def test_the_actor_comes_to_name_the_clips_targets(built, monkeypatch):
    monkeypatch.setattr(dagger, "_MINIBATCH", 16)
    monkeypatch.setattr(dagger, "_ROUNDS", 2)
    learner = make_learner(built.environment, CONFIG.network, CONFIG.ppo, total_steps=1000)
    policy = first_policy(learner)
    row = jnp.arange(8)
    observation = built.environment.start(built.world, row, KEY).observation
    targets = dagger.clip_targets(built)[row, 0, 0]

    def miss(policy) -> float:
        action = learner.act(policy, observation)
        target = built.world.target_centre + built.world.target_scale * action
        return float(np.sqrt(np.mean(np.square(target - targets))))

    log: list[str] = []
    setup = dagger.Setup(built, built.world)
    after = dagger.warm_start(learner, setup, policy, KEY, log.append)
    assert miss(after) < 0.5 * miss(policy)
    std = learner.model.distribution(after.actor, jnp.zeros_like(observation), jnp.ones(()))[1]
    np.testing.assert_allclose(std, CONFIG.network.initial_std, rtol=0.5)
    assert "degrees" in log[-1]


def test_what_follows_on_an_arc_is_the_same_moment_of_its_clip(built):
    """Two clips of a family, the second one with straighter knees by a tenth."""
    env = built.environment
    bend = repeated(clips(env.character)["lower"][0], 2)
    qpos = bend.qpos.copy()
    qpos[:, 7:] *= 0.9
    family = [bend, dataclasses.replace(bend, qpos=qpos)]
    starts, following = reference_states([family], (0.0, 0.5), env.character, env.engine, 1000)
    own = np.asarray(starts.physics.kinematics.qpos)[:, 7:]
    half = len(own) // 2
    np.testing.assert_allclose(own[half:], 0.9 * own[:half], atol=1e-6)
    assert following.angles.shape == (2 * half, 2, FOLLOWING, own.shape[1])
    # whichever clip it starts on: the next frame of the first, and that of the second
    for first in (0, half):
        after = following.angles[first : first + half - 1, :, 0]
        np.testing.assert_allclose(after[:, 0], own[1:half], atol=1e-6)
        np.testing.assert_allclose(after[:, 1], own[half + 1 :], atol=1e-6)
    np.testing.assert_array_equal(following.turns, [0.0, 0.5])


def test_targets_of_an_arc_lie_to_its_side():
    turns, count = np.array([0.0, 1.0, -1.0]), 2000
    arc = np.repeat(np.arange(3), count)
    found = np.asarray(dagger._bearings(turns, arc, KEY)).reshape(3, count)
    np.testing.assert_allclose(found.min(axis=1), [-0.5, 0.5, -np.pi], atol=0.01)
    np.testing.assert_allclose(found.max(axis=1), [0.5, np.pi, -0.5], atol=0.01)
    (alone,) = np.asarray(dagger._bearings(np.zeros(1), arc[:count], KEY)).reshape(1, count)
    assert alone.min() < -3.0
    assert alone.max() > 3.0


@pytest.mark.slow
def test_over_a_meta_policy_only_the_new_clips_are_learned(built, monkeypatch, tmp_path):
    monkeypatch.setattr(dagger, "_MINIBATCH", 16)
    monkeypatch.setattr(dagger, "_ROUNDS", 2)
    monkeypatch.setattr(dagger, "_EPOCHS", 150)
    monkeypatch.setattr("getup_jax.envs.composite.meta.chain.load_clips", lambda *_: built.clips)
    trained = make_learner(built.environment, CONFIG.network, CONFIG.ppo, total_steps=1000)
    item = {"policy": first_policy(trained, seed=5), "prior": None}
    meta = str(save_learner(tmp_path / "checkpoints", 1, {"none": np.zeros(1)}, CONFIG, item))
    config = dataclasses.replace(CONFIG, composite=dataclasses.replace(COMPOSITE, meta=meta))
    env, world = with_meta(config, built)
    learner = make_learner(env, CONFIG.network, CONFIG.ppo, total_steps=1000)
    policy = first_policy(learner)
    new = np.arange(env.action_size) < 10
    row = jnp.arange(8)
    start = built.environment.start(built.world, row, KEY)
    observation = env.adopt(world, start, start.goals, KEY).observation
    clip = dagger.clip_targets(built)[row, 0, 0] - built.world.target_centre
    wanted = np.where(new, clip / built.world.target_scale, observation[:, -env.action_size :])

    def miss(policy) -> np.ndarray:
        gap = built.world.target_scale * (learner.act(policy, observation) - wanted)
        return np.sqrt(np.mean(np.square(gap), axis=0))

    setup = dagger.Setup(built, world, new)
    after = dagger.warm_start(learner, setup, policy, KEY, lambda text: None)
    assert miss(after)[new].mean() < 0.5 * miss(policy)[new].mean()
    assert miss(after)[~new].mean() < miss(policy)[~new].mean()
