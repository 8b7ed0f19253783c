from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose
from tiny_composite import CONFIG, tiny_composite

from getup_jax.api import Env
from getup_jax.config import Config, ConfigError, NetworkConfig
from getup_jax.envs.composite.meta.chain import with_meta
from getup_jax.physics.character import load_character
from getup_jax.rl.actor_critic import META_LOGIT, make_actor_critic, normalized, observe
from getup_jax.rl.learner import make_learner
from getup_jax.runtime.checkpoint import save_learner
from getup_jax.training import run
from probes import Probe

STATE = {"none": np.zeros(1)}  # of a training that these tests do not go on with


@dataclasses.dataclass(frozen=True)
class MetaProbe(Probe):
    """Observes [step, sign, meta action 2]; only the sizes matter."""

    observation_size: int = 4
    action_size: int = 2
    meta_size: int = 2


def test_the_mean_is_equation_10():
    network = NetworkConfig(hidden_sizes=(8,), activation="tanh", initial_std=0.1)
    model = make_actor_critic(MetaProbe(), network)
    actor = model.actor.init(jax.random.key(0), jnp.zeros(2))
    seen, action = jnp.asarray([[0.3, -0.7]]), jnp.asarray([[2.0, -4.0]])
    both = jnp.concatenate([seen, action], axis=-1)
    mean, std = model.distribution(actor, both, jnp.full((), 0.5))
    output = np.asarray(model.actor.apply(actor, seen))
    weight = 1.0 / (1.0 + np.exp(-(output[:, 4:] + META_LOGIT)))
    assert_allclose(mean, output[:, :2] + weight * action, rtol=1e-5)
    assert_allclose(model.meta_weight(actor, both), weight, rtol=1e-5)
    assert_allclose(std, 0.05 * np.exp(output[:, 2:4]), rtol=1e-5)
    # the critic does not see the meta action, and no gradient reaches it
    critic = model.critic.init(jax.random.key(1), jnp.zeros(2))
    assert_allclose(model.output(critic, both), model.output(critic, both.at[:, 2:].add(5.0)))
    gradient = jax.grad(lambda x: jnp.sum(model.mean(actor, x)))(both)
    assert_allclose(gradient[:, 2:], 0.0)


def test_the_std_stays_in_its_range():
    network = NetworkConfig(hidden_sizes=(), initial_std=0.1, std_range=0.5)
    model = make_actor_critic(Probe(), network)
    actor = jax.jit(model.actor.init)(jax.random.key(0), jnp.zeros(2))
    seen = jnp.asarray([[1e4, 0.0], [-1e4, 0.0], [0.0, 0.0]])
    _, std = model.distribution(actor, seen, jnp.ones(()))
    low, high = 0.1 * np.exp(-0.5), 0.1 * np.exp(0.5)
    assert_allclose(np.sort(np.asarray(std)[:, 0]), [low, 0.1, high], rtol=1e-5)


def test_statistics_leave_the_meta_action_as_it_is():
    model = make_actor_critic(MetaProbe(), NetworkConfig(hidden_sizes=(4,)))
    policy = jax.jit(lambda key: model.init(key, CONFIG.ppo).policy)(jax.random.key(0))
    x = jnp.asarray(np.random.default_rng(0).normal(3.0, 2.0, size=(64, 4)), jnp.float32)
    policy = observe(policy, x)
    seen = normalized(policy, x)
    assert_allclose(seen[:, 2:], x[:, 2:])
    assert_allclose(seen[:, :2].mean(axis=0), 0.0, atol=1e-4)


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """A task, and the checkpoint of an untrained policy for it."""
    built = tiny_composite(load_character(CONFIG.physics))
    learner = make_learner(built.environment, CONFIG.network, CONFIG.ppo, 100)
    state = jax.jit(learner.init_learner)(jax.random.key(3))
    policy = {"policy": state.policy, "prior": None}
    folder = tmp_path_factory.mktemp("meta") / "checkpoints"
    return built, learner, state.policy, save_learner(folder, 1, STATE, CONFIG, policy)


def _config(path, **changes) -> Config:
    assert CONFIG.composite is not None
    return dataclasses.replace(
        CONFIG, composite=dataclasses.replace(CONFIG.composite, meta=str(path), **changes)
    )


def test_a_meta_action_reaches_the_pose_that_its_own_policy_would(trained):
    """The new task has another action 0 and 1; the servo target stays."""
    built, learner, policy, path = trained
    # `clips` would need files of the sines' names
    config = _config(path, action_scale=0.5, action_centre="neutral")
    env, world = built.environment, built.world
    observation = jnp.asarray(
        np.random.default_rng(0).normal(size=(3, env.observation_size)), jnp.float32
    )
    own = world.target_centre + world.target_scale * learner.act(policy, observation)
    neutral = jnp.asarray(env.character.neutral_qpos[7:], jnp.float32)
    new = dataclasses.replace(built, environment=dataclasses.replace(env, config=config.composite))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("getup_jax.envs.composite.meta.chain.load_clips", lambda *_: built.clips)
        task, meta_world = with_meta(config, new)
    still = dataclasses.replace(task, sample=False)
    action = jax.jit(still.meta_action)(meta_world, [observation], jax.random.key(0))
    assert_allclose(neutral + 0.5 * world.target_scale * action, own, atol=1e-4)
    drawn = jax.jit(task.meta_action)(meta_world, [observation], jax.random.key(0))
    assert np.abs(np.asarray(drawn - action)).max() > 1e-3
    assert task.observation_size == env.observation_size + 28
    front = Env(CONFIG, 1, task, meta_world, ())  # which has no engine of its own
    assert front.control_dt == env.engine.control_dt


@pytest.mark.parametrize("warm", [True, False])
@pytest.mark.parametrize("has_meta", [True, False])
def test_a_job_has_the_meta_policy_and_the_warm_start(trained, monkeypatch, has_meta, warm):
    built, _, _, path = trained
    config = _config(path) if has_meta else CONFIG
    composite = dataclasses.replace(config.composite, warm_start=warm)
    env = dataclasses.replace(built.environment, config=composite)
    made = dataclasses.replace(built, environment=env)
    monkeypatch.setattr(run, "build_composite", lambda *_: made)
    monkeypatch.setattr("getup_jax.envs.composite.meta.chain.load_clips", lambda *_: built.clips)
    log: list[str] = []
    _, job = run.build_composite_job(config, log.append)
    assert (job.prepare is not None) == warm
    assert any(f"meta policy: {path}" in line for line in log) == has_meta
    assert (job.learner.env is env) != has_meta


def test_hinges_are_new_where_their_clips_are(trained, monkeypatch):
    built, _, _, path = trained
    groups = dict(CONFIG.composite.groups)
    groups["upper"] = dataclasses.replace(groups["upper"], clips=("aim",))
    config = _config(path)
    composite = dataclasses.replace(config.composite, groups=groups)
    env = dataclasses.replace(built.environment, config=composite)
    monkeypatch.setattr("getup_jax.envs.composite.meta.chain.load_clips", lambda *_: built.clips)
    task, _ = with_meta(
        dataclasses.replace(config, composite=composite),
        dataclasses.replace(built, environment=env),
    )
    assert task.new[env.character.joint("arm_r_abd")]
    assert not task.new[env.character.joint("shin_l_flex")]


def test_a_meta_policy_of_another_character_or_task_is_refused(trained, tmp_path):
    built, _, policy, _ = trained
    other = dataclasses.replace(
        CONFIG, physics=dataclasses.replace(CONFIG.physics, character="humanoid49")
    )
    item = {"policy": policy, "prior": None}
    wrong = save_learner(tmp_path / "other", 1, STATE, other, item)
    with pytest.raises(ConfigError, match=r"composite\.meta: .*humanoid49, expected humanoid28"):
        with_meta(_config(wrong), built)
    getup = save_learner(tmp_path / "getup", 1, STATE, Config(), item)
    with pytest.raises(ConfigError, match=r"composite\.meta: .*of the get-up task"):
        with_meta(_config(getup), built)
    goals = dataclasses.replace(
        CONFIG,
        composite=dataclasses.replace(CONFIG.composite, goals={"aiming": {}}),
    )
    more = save_learner(tmp_path / "goals", 1, STATE, goals, item)
    with pytest.raises(ConfigError, match=r"composite\.meta: .*goals aiming"):
        with_meta(_config(more), built)
