from __future__ import annotations

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tiny_task import untrained_prior

from eval_samples import SMALL, make_policy, make_task, save_policy
from getup_jax import lessons, transfer
from getup_jax.algo.actor_critic import observe
from getup_jax.algo.learner import Learner
from getup_jax.algo.state import PolicyState
from getup_jax.checkpoint import CHECKPOINTS, LoadedPolicy, load_policy, save_learner
from getup_jax.config import Config
from getup_jax.storage import CheckpointError
from getup_jax.tasks.actions import Units
from getup_jax.tasks.build import BuiltTask
from getup_jax.tasks.observation import Observer
from getup_jax.tasks.symmetry import find_symmetry
from getup_jax.transfer import Origin, carry_over

KEY = jax.random.PRNGKey(0)
CONFIG = dataclasses.replace(
    SMALL,
    network=dataclasses.replace(SMALL.network, hidden_sizes=(64,)),
    ppo=dataclasses.replace(
        SMALL.ppo, num_envs=16, num_steps=8, minibatch_size=64, normalize_observation=True
    ),
)


@pytest.fixture(scope="module")
def task():
    built = make_task(CONFIG)
    world = built.world.replace(prior=untrained_prior(built.environment.character, seed=1))
    return dataclasses.replace(built, world=world)


@pytest.fixture(scope="module")
def old(task) -> Units:
    return Units(untrained_prior(task.environment.character, seed=0), 0.5)


def samples(rng: np.random.Generator, size: int) -> tuple[jax.Array, jax.Array]:
    action = rng.normal(size=(size, 65)).astype(np.float32)
    return jnp.asarray(action), jnp.asarray(rng.uniform(0.2, 1.0, (size, 3)), jnp.float32)


def test_a_translated_action_has_the_same_servo_target(task, old):
    new = Units(task.world.prior, 0.25)
    action, condition = samples(np.random.default_rng(0), 32)
    translated = old.translate(action, condition, new)
    np.testing.assert_allclose(
        new.target(translated, condition), old.target(action, condition), atol=2e-6
    )
    assert np.abs(translated - action).max() > 0.5  # and is another action


def test_the_latent_is_that_of_the_old_pose_and_not_of_the_offsets(task, old):
    new = Units(task.world.prior, 0.25)
    action, condition = samples(np.random.default_rng(1), 8)
    bare = action.at[:, 16:].set(0.0)
    moved = old.translate(action, condition, new) - old.translate(bare, condition, new)
    np.testing.assert_allclose(moved[:, :16], 0.0, atol=1e-6)
    np.testing.assert_allclose(moved[:, 16:], 2.0 * action[:, 16:], atol=1e-5)


def test_an_action_that_means_the_same_leaves_the_policy_alone(task):
    learner, policy = make_policy(task, CONFIG)
    settings, log = CONFIG.task, []
    same = carry_over(
        learner, task.world, policy, Origin(settings, task.world.prior), KEY, log.append
    )
    assert same is policy
    assert log == []


def test_the_actor_learns_the_old_targets(task, old, monkeypatch):
    monkeypatch.setattr(transfer, "_ROLLOUTS", 8)
    monkeypatch.setattr(lessons, "_EPOCHS", 60)
    monkeypatch.setattr(lessons, "_MINIBATCH", 64)
    learner, policy = make_policy(task, CONFIG)
    settings = dataclasses.replace(CONFIG.task, offset_scale=old.offset_scale)
    log: list[str] = []
    taught = carry_over(learner, task.world, policy, Origin(settings, old.prior), KEY, log.append)
    after, before, _ = (float(word) for word in log[-1].split() if word[0].isdigit())
    assert after < 0.3 * before
    block = learner.env.observer.slices()["action"]
    kept = np.ones(learner.env.observation_size, bool)
    kept[block] = False
    for name in ("mean", "variance"):
        a, b = getattr(policy.statistics, name), getattr(taught.statistics, name)
        np.testing.assert_array_equal(a[kept], b[kept])
        assert (a[block] != b[block]).any()


def test_offsets_are_avoided_where_latents_can_say_the_same(task, monkeypatch):
    monkeypatch.setattr(transfer, "_ROLLOUTS", 8)
    monkeypatch.setattr(lessons, "_EPOCHS", 60)
    monkeypatch.setattr(lessons, "_MINIBATCH", 64)
    learner, policy = make_policy(task, CONFIG)
    lengths = []
    for weight in (0.0, 1.0):
        monkeypatch.setattr(lessons, "_NATURAL", weight)
        log: list[str] = []
        settings = dataclasses.replace(CONFIG.task, offset_scale=0.5)
        prior = untrained_prior(task.environment.character, seed=0)
        carry_over(learner, task.world, policy, Origin(settings, prior), KEY, log.append)
        lengths.append(float(log[-1].split()[-2]))
    assert lengths[1] < 0.7 * lengths[0]


def test_the_difference_is_the_root_mean_square_in_degrees(task, old):
    learner, policy = make_policy(task, CONFIG)
    action, condition = samples(np.random.default_rng(2), 4)
    observation = jnp.ones((4, learner.env.observation_size))
    target = old.target(learner.act(policy, observation), condition) + math.radians(3.0)
    lesson = lessons.Lesson(observation, action, target, condition)
    assert lessons.compare(learner, policy, old, lesson)[0] == pytest.approx(3.0, rel=1e-3)


# --- mirror images


@pytest.fixture(scope="module")
def mirrored(task):
    """The task with a prior that has mirror images, and so with a symmetry."""
    character = task.environment.character
    prior = untrained_prior(character, seed=1, mirrored=True)
    symmetry = find_symmetry(CONFIG, character, task.environment.observer, prior)
    env = dataclasses.replace(task.environment, symmetry=symmetry)
    return BuiltTask(env, task.world.replace(prior=prior), prior, task.getups)


def plain(config: Config = CONFIG) -> Config:
    return dataclasses.replace(
        config,
        network=dataclasses.replace(config.network, mirror=False),
        prior=None if config.prior is None else dataclasses.replace(config.prior, mirror=False),
    )


def observed(policy: PolicyState, learner: Learner, seed: int = 0) -> PolicyState:
    """The policy after it has seen random observations."""
    size = learner.env.observation_size
    seen = jax.random.normal(jax.random.PRNGKey(seed), (64, size)) + 1.0
    return observe(policy, seen, learner.model.symmetry)


@pytest.mark.parametrize("was_mirrored", [False, True])
def test_a_policy_is_taught_to_networks_with_and_without_mirror_images(
    mirrored, was_mirrored, monkeypatch
):
    monkeypatch.setattr(transfer, "_ROLLOUTS", 8)
    monkeypatch.setattr(lessons, "_EPOCHS", 60)
    monkeypatch.setattr(lessons, "_MINIBATCH", 64)
    configs = (CONFIG, plain()) if was_mirrored else (plain(), CONFIG)
    (teacher, policy), (learner, _) = (make_policy(mirrored, config) for config in configs)
    policy = observed(policy, teacher)
    kernel = 0.1 * jax.random.normal(KEY, policy.actor["params"]["output"]["kernel"].shape)
    output = {**policy.actor["params"]["output"], "kernel": kernel}
    actor = {**policy.actor, "params": {**policy.actor["params"], "output": output}}
    policy = dataclasses.replace(policy, actor=actor)
    start = Origin(CONFIG.task, mirrored.world.prior, teacher.model.symmetry)
    log: list[str] = []
    taught = carry_over(learner, mirrored.world, policy, start, KEY, log.append)
    after, before, _ = (float(word) for word in log[-1].split() if word[0].isdigit())
    assert after < 0.5 * before
    if not was_mirrored:
        image = mirrored.environment.symmetry.observation
        np.testing.assert_allclose(image(taught.statistics.mean), taught.statistics.mean, atol=1e-5)


def loaded_from(folder, task: BuiltTask, config: Config) -> LoadedPolicy:
    return load_policy(save_policy(folder, task, config))


def test_what_a_checkpoint_was_trained_with_is_read_off_it(tmp_path, mirrored, task):
    learner, _ = make_policy(mirrored, CONFIG)
    both = loaded_from(tmp_path / "both", mirrored, CONFIG)
    assert transfer.origin(learner, mirrored.world, both, whole=True).symmetry is not None
    free = dataclasses.replace(CONFIG, network=plain().network)
    for config, built in ((free, mirrored), (plain(), task), (CONFIG, task)):
        loaded = loaded_from(tmp_path / f"{config.network.mirror} {built is task}", built, config)
        start = transfer.origin(learner, mirrored.world, loaded, whole=False)
        assert start.symmetry is None
        assert start.prior.mirrored == built.prior.mirrored


def test_a_critic_is_not_taught(tmp_path, mirrored, task):
    learner, _ = make_policy(mirrored, CONFIG)
    old = loaded_from(tmp_path, task, plain())
    expected = (
        r"network\.mirror is false there; expected the same here with train\.init_learner; "
        r"set network\.mirror=false prior\.mirror=false"
    )
    with pytest.raises(CheckpointError, match=expected):
        transfer.origin(learner, mirrored.world, old, whole=True)
    other, _ = make_policy(task, plain())
    new = loaded_from(tmp_path / "new", mirrored, CONFIG)
    with pytest.raises(CheckpointError, match=r"set network\.mirror=true prior\.mirror=true"):
        transfer.origin(other, task.world, new, whole=True)


def test_without_a_prior_nothing_is_taught(tmp_path, mirrored):
    env = mirrored.environment
    observer = Observer.of(env.character, 4, 49)
    symmetry = find_symmetry(CONFIG, env.character, observer, None)
    env = dataclasses.replace(env, observer=observer, symmetry=symmetry, latent_size=0)
    bare = BuiltTask(env, mirrored.world.replace(prior=None), None, mirrored.getups)
    config = dataclasses.replace(CONFIG, prior=None)
    learner, policy = make_policy(bare, config)
    for saved in (config, plain(config)):
        folder = tmp_path / str(saved.network.mirror)
        item = {"policy": policy, "prior": None}
        save_learner(folder / CHECKPOINTS, 1, policy, saved, item, {})
        if saved.network.mirror:
            assert transfer.origin(learner, bare.world, load_policy(folder), False).prior is None
            continue
        with pytest.raises(CheckpointError, match=r"pose prior; set network\.mirror=false$"):
            transfer.origin(learner, bare.world, load_policy(folder), whole=False)
    with pytest.raises(CheckpointError, match="was trained without a pose prior"):
        transfer.origin(
            make_policy(mirrored, CONFIG)[0], mirrored.world, load_policy(folder), False
        )
