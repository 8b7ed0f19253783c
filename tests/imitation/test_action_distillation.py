from __future__ import annotations

import dataclasses
import math
import re
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tiny_task import untrained_prior

from compiled import first_policy
from eval_samples import SMALL, make_policy, make_task, save_policy
from getup_jax.config import Config
from getup_jax.envs.getup.action_decoder import ActionDecoder
from getup_jax.envs.getup.build import BuiltTask
from getup_jax.envs.getup.observation import Observer
from getup_jax.envs.getup.symmetry import find_symmetry
from getup_jax.imitation import action_distillation, action_regression, demonstrations
from getup_jax.imitation.action_distillation import Teacher, carry_over, make_teacher
from getup_jax.imitation.demonstrations import Demonstrations
from getup_jax.rl.actor_critic import observe
from getup_jax.rl.learner import Learner
from getup_jax.rl.state import PolicyState
from getup_jax.runtime.checkpoint import CHECKPOINTS, LoadedPolicy, load_policy, save_learner
from getup_jax.runtime.pytree_store import CheckpointError

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
def old(task) -> ActionDecoder:
    return ActionDecoder(untrained_prior(task.environment.character, seed=0), 0.5)


def samples(rng: np.random.Generator, size: int) -> tuple[jax.Array, jax.Array]:
    action = rng.normal(size=(size, 65)).astype(np.float32)
    return jnp.asarray(action), jnp.asarray(rng.uniform(0.2, 1.0, (size, 3)), jnp.float32)


def test_a_translated_action_has_the_same_servo_target(task, old):
    new = ActionDecoder(task.world.prior, 0.25)
    action, condition = samples(np.random.default_rng(0), 32)
    translated = old.translate(action, condition, new)
    np.testing.assert_allclose(
        new.target(translated, condition), old.target(action, condition), atol=2e-6
    )
    assert np.abs(translated - action).max() > 0.5  # and is another action


def test_the_latent_is_that_of_the_old_pose_and_not_of_the_offsets(task, old):
    new = ActionDecoder(task.world.prior, 0.25)
    action, condition = samples(np.random.default_rng(1), 8)
    bare = action.at[:, 16:].set(0.0)
    moved = old.translate(action, condition, new) - old.translate(bare, condition, new)
    np.testing.assert_allclose(moved[:, :16], 0.0, atol=1e-6)
    np.testing.assert_allclose(moved[:, 16:], 2.0 * action[:, 16:], atol=1e-5)


def test_a_prior_alike_keeps_the_action(task):
    """Its pose encoded anew would have other latents: a teacher saw what no policy had done."""
    action, condition = samples(np.random.default_rng(2), 8)
    first, second = (
        ActionDecoder(untrained_prior(task.environment.character, seed=0), 0.5) for _ in range(2)
    )
    np.testing.assert_array_equal(first.translate(action, condition, second), action)


def teacher_of(learner: Learner, policy: PolicyState, decoder: ActionDecoder) -> Teacher:
    return Teacher(
        learner.model, policy, decoder, learner.env.observer, learner.env.config.lookahead_s
    )


def quickly(monkeypatch, rounds: int = 1) -> None:
    """Few and small demonstrations."""
    monkeypatch.setattr(action_distillation, "_ROUNDS", rounds)
    monkeypatch.setattr(action_distillation, "_SAMPLES", 896)
    monkeypatch.setattr(action_regression, "EPOCHS", 60)
    monkeypatch.setattr(action_regression, "_MINIBATCH", 64)


@pytest.fixture(scope="module")
def demo_memory() -> dict[str, Any]:
    return {}


@pytest.fixture
def remembered(demo_memory, monkeypatch) -> None:
    """What the old policy sees is collected once for all tests that teach one and the same."""
    collect = demonstrations.collect

    def collected_once(*args: Any) -> Demonstrations:
        if "old" not in demo_memory:
            demo_memory["old"] = collect(*args)
        return demo_memory["old"]

    monkeypatch.setattr(demonstrations, "collect", collected_once)


def differences(log: list[str]) -> tuple[float, float, float]:
    """Degrees after and before, and |dq|_1, of the last round."""
    after, before, offsets = (float(x) for x in re.findall(r"[0-9]+\.[0-9]+", log[-1]))
    return after, before, offsets


def test_an_action_that_means_the_same_leaves_the_policy_alone(task):
    learner, policy = make_policy(task, CONFIG)
    log: list[str] = []
    teacher = teacher_of(learner, policy, learner.env.decoder(task.world))
    own = first_policy(learner, seed=1)
    assert carry_over(learner, task.world, own, teacher, KEY, log.append) is policy
    assert log == []


@pytest.mark.usefixtures("remembered")
def test_the_actor_learns_the_old_targets(task, old, monkeypatch):
    quickly(monkeypatch)
    learner, policy = make_policy(task, CONFIG)
    log: list[str] = []
    teacher = teacher_of(learner, policy, old)
    distilled = carry_over(learner, task.world, policy, teacher, KEY, log.append)
    after, before, _ = differences(log)
    assert after < 0.3 * before
    block = learner.env.observer.slices()["action"]
    kept = np.ones(learner.env.observation_size, bool)
    kept[block] = False
    for name in ("mean", "variance"):
        a, b = getattr(policy.statistics, name), getattr(distilled.statistics, name)
        np.testing.assert_array_equal(a[kept], b[kept])
        assert (a[block] != b[block]).any()


@pytest.mark.usefixtures("remembered")
def test_offsets_are_avoided_where_latents_can_say_the_same(task, old, monkeypatch):
    quickly(monkeypatch)
    learner, policy = make_policy(task, CONFIG)
    lengths = []
    for weight in (0.0, 1.0):
        monkeypatch.setattr(action_regression, "_NATURAL", weight)
        log: list[str] = []
        teacher = teacher_of(learner, policy, old)
        carry_over(learner, task.world, policy, teacher, KEY, log.append)
        lengths.append(differences(log)[2])
    assert lengths[1] < 0.7 * lengths[0]


def test_the_difference_is_the_root_mean_square_in_degrees(task, old):
    learner, policy = make_policy(task, CONFIG)
    action, condition = samples(np.random.default_rng(2), 4)
    observation = jnp.ones((4, learner.env.observation_size))
    target = old.target(learner.act(policy, observation), condition) + math.radians(3.0)
    demos = Demonstrations(observation, action, target, condition)
    assert action_regression.compare(learner, policy, old, demos)[0] == pytest.approx(3.0, rel=1e-3)


# --- mirror images


@pytest.fixture(scope="module")
def mirrored(task):
    """The task with a prior that has mirror images, and so with a symmetry."""
    character = task.environment.character
    prior = untrained_prior(character, seed=1, mirrored=True)
    symmetry = find_symmetry(character, task.environment.observer, prior)
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


def lively(policy: PolicyState) -> PolicyState:
    """The policy with an output layer that is far from zero."""
    params = dict(policy.actor["params"])
    for name in params.keys() & {"output", "output_odd"}:
        kernel = 0.1 * jax.random.normal(KEY, params[name]["kernel"].shape)
        params[name] = {**params[name], "kernel": kernel}
    return dataclasses.replace(policy, actor={**policy.actor, "params": params})


def test_a_policy_is_distilled_into_networks_with_mirror_images(mirrored, monkeypatch):
    quickly(monkeypatch)
    (taught_before, policy), (learner, own) = (make_policy(mirrored, c) for c in (plain(), CONFIG))
    policy = lively(observed(policy, taught_before))
    teacher = teacher_of(taught_before, policy, learner.env.decoder(mirrored.world))
    log: list[str] = []
    distilled = carry_over(learner, mirrored.world, own, teacher, KEY, log.append)
    after, before, _ = differences(log)
    assert after < 0.5 * before
    image = mirrored.environment.symmetry.observation
    mean = distilled.statistics.mean
    np.testing.assert_allclose(image(mean), mean, atol=1e-5)


def test_networks_without_mirror_images_begin_with_weights_that_have_them(mirrored):
    (taught_before, policy), (learner, own) = (make_policy(mirrored, c) for c in (CONFIG, plain()))
    policy = lively(observed(policy, taught_before))
    teacher = teacher_of(taught_before, policy, learner.env.decoder(mirrored.world))
    log: list[str] = []
    begun = carry_over(learner, mirrored.world, own, teacher, KEY, log.append)
    assert log == []  # nothing has to be distilled
    seen = jax.random.normal(KEY, (16, learner.env.observation_size))
    expected = jax.jit(taught_before.act)(policy, seen)
    assert np.abs(expected).max() > 0.5
    np.testing.assert_allclose(jax.jit(learner.act)(begun, seen), expected, atol=1e-4)


def loaded_from(folder, task: BuiltTask, config: Config) -> LoadedPolicy:
    return load_policy(save_policy(folder, task, config))


def test_what_a_checkpoint_was_trained_with_is_read_off_it(tmp_path, mirrored, task):
    learner, own = make_policy(mirrored, CONFIG)
    free = dataclasses.replace(CONFIG, network=plain().network)
    cases = (CONFIG, mirrored, True), (free, mirrored, False), (plain(), task, False)
    for number, (config, built, expected) in enumerate(cases):
        loaded = loaded_from(tmp_path / f"case {number}", built, config)
        teacher = make_teacher(CONFIG, learner, mirrored.world, loaded, own)
        assert (teacher.model.symmetry is not None) == expected
        assert (teacher.policy_for(learner) is not None) == expected
        assert teacher.decoder.prior.mirrored == built.prior.mirrored
        jax.tree.map(np.testing.assert_array_equal, teacher.policy.actor, loaded.policy["actor"])


def resumed(config: Config) -> Config:
    return dataclasses.replace(
        config, train=dataclasses.replace(config.train, init_from="x", init_learner=True)
    )


def test_a_learner_goes_on_only_with_its_own_networks(tmp_path, mirrored, task):
    learner, own = make_policy(mirrored, CONFIG)
    old = loaded_from(tmp_path / "old", task, plain())
    expected = (
        r"network\.mirror is false there; expected the same here with train\.init_learner; "
        r"set network\.mirror=false prior\.mirror=false"
    )
    with pytest.raises(CheckpointError, match=expected):
        make_teacher(resumed(CONFIG), learner, mirrored.world, old, own)
    other, other_own = make_policy(task, plain())
    new = loaded_from(tmp_path / "new", mirrored, CONFIG)
    with pytest.raises(CheckpointError, match=r"set network\.mirror=true prior\.mirror=true"):
        make_teacher(resumed(plain()), other, task.world, new, other_own)


def without_prior(task: BuiltTask) -> BuiltTask:
    env = task.environment
    observer = Observer.of(env.character, 4, 49)
    symmetry = find_symmetry(env.character, observer, None)
    env = dataclasses.replace(env, observer=observer, symmetry=symmetry, latent_size=0)
    return BuiltTask(env, task.world.replace(prior=None), None, task.getups)


@pytest.mark.slow
def test_a_policy_without_a_prior_is_taught_as_well(tmp_path, mirrored, monkeypatch):
    quickly(monkeypatch)
    bare, config = without_prior(mirrored), dataclasses.replace(CONFIG, prior=None)
    learner, own = make_policy(bare, config)
    for saved in (config, plain(config)):
        _, policy = make_policy(bare, saved)
        folder = tmp_path / str(saved.network.mirror)
        save_learner(folder / CHECKPOINTS, 1, policy, saved, {"policy": policy, "prior": None}, {})
        log: list[str] = []
        teacher = make_teacher(config, learner, bare.world, load_policy(folder), own)
        carry_over(learner, bare.world, own, teacher, KEY, log.append)
        assert bool(log) != saved.network.mirror


def test_with_and_without_a_prior_are_two_kinds_of_policies(tmp_path, mirrored):
    bare, config = without_prior(mirrored), dataclasses.replace(CONFIG, prior=None)
    _, policy = make_policy(bare, config)
    save_learner(tmp_path / CHECKPOINTS, 1, policy, config, {"policy": policy, "prior": None}, {})
    learner, own = make_policy(mirrored, CONFIG)
    with pytest.raises(CheckpointError, match="without a pose prior, this run has one; set"):
        make_teacher(CONFIG, learner, mirrored.world, load_policy(tmp_path), own)
    loaded = loaded_from(tmp_path / "with", mirrored, CONFIG)
    learner, own = make_policy(bare, config)
    with pytest.raises(CheckpointError, match="trained with a pose prior, this run has none"):
        make_teacher(config, learner, bare.world, loaded, own)


# --- another observation


LONGER = dataclasses.replace(
    CONFIG,
    network=dataclasses.replace(CONFIG.network, hidden_sizes=(48, 32)),
    task=dataclasses.replace(CONFIG.task, lookahead_s=(0.0, 0.05, 0.1, 0.2, 0.3, 0.8)),
)


@pytest.mark.slow
def test_other_sizes_that_see_more_of_the_curve_are_distilled_into(tmp_path, task, monkeypatch):
    quickly(monkeypatch, rounds=2)
    loaded = loaded_from(tmp_path, task, CONFIG)
    built = make_task(LONGER)
    learner, own = make_policy(built, LONGER)
    teacher = make_teacher(LONGER, learner, built.world, loaded, own)
    log: list[str] = []
    teacher = dataclasses.replace(teacher, policy=observed(teacher.policy, make_policy(task)[0]))
    distilled = carry_over(learner, built.world, own, teacher, KEY, log.append)
    after, before, _ = differences(log)
    assert len(log) == 3
    assert after < before
    # What both see has the statistics of the old one.
    old, new = teacher.policy.statistics.mean, distilled.statistics.mean
    block = learner.env.observer.slices()["targets"]
    kept = [0, 1, 2, 6, 7, 8, 9, 10, 11, 12, 13, 14]
    np.testing.assert_array_equal(new[block][np.array(kept)], old[block.start : block.start + 12])
    np.testing.assert_array_equal(new[: block.start], old[: block.start])


def test_what_the_old_policy_saw_must_be_there(tmp_path, task):
    loaded = loaded_from(tmp_path, task, CONFIG)
    short = dataclasses.replace(
        CONFIG, task=dataclasses.replace(CONFIG.task, lookahead_s=(0.0, 0.1))
    )
    built = make_task(short)
    learner, own = make_policy(built, short)
    with pytest.raises(CheckpointError, match=r"sees the curve 0\.2, 0\.3 s ahead; expected these"):
        make_teacher(short, learner, built.world, loaded, own)
