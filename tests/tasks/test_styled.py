"""Getting up with several objectives: the same task, other rewards, windows beside it."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from tiny_task import CONFIG, getups

from getup_jax.config import (
    CompositeConfig,
    ConfigError,
    DiscriminatorConfig,
    GroupConfig,
    NetworkConfig,
    PPOConfig,
)
from getup_jax.envs.composite.discriminator_rewards import make_discriminator_rewards
from getup_jax.envs.composite.reference_windows import travel
from getup_jax.envs.getup.build import assemble
from getup_jax.envs.getup.styled import with_objectives
from getup_jax.rl.learner import make_learner

SIZE = 6
STYLE = CompositeConfig(
    task="getup",
    terms=("height", "posture", "natural"),
    groups={"style": GroupConfig(links=("full",))},
    end_reward=-3.0,
    discriminator=DiscriminatorConfig(
        gru_size=8, hidden_sizes=(8,), heads=2, minibatch_size=SIZE * 4
    ),
)
NETWORK = NetworkConfig(hidden_sizes=(8,))
PPO = PPOConfig(num_envs=SIZE, num_steps=4, minibatch_size=12, epochs=1, popart=True)


def config_with(composite: CompositeConfig | None):
    return dataclasses.replace(CONFIG, composite=composite, network=NETWORK, ppo=PPO)


def silent(text: str) -> None:
    """No log."""


@pytest.fixture(scope="module")
def styled(built):
    return with_objectives(config_with(STYLE), built, silent)


@pytest.fixture(scope="module")
def step(styled):
    """The state before a step and after it, and what it returned."""
    env, world = styled.environment, styled.world

    @jax.jit
    def run(key):
        state = env.init(world, key, SIZE)
        return state, *env.advance(world, state, state.action)

    return run(jax.random.PRNGKey(0))


def test_objectives_are_imitations_then_reward_terms(styled, step):
    env = styled.environment
    assert env.objectives == ("style", "height", "posture", "natural")
    assert env.num_objectives == 4
    one = dataclasses.replace(env, composite=dataclasses.replace(STYLE, multi_objective=False))
    assert one.num_objectives == 1
    _, _, output = step
    assert output.reward.shape == (SIZE, 4)
    assert_allclose(output.reward[:, 0], np.where(output.terminated, -3.0, 0.0))
    for index, name in enumerate(STYLE.terms, 1):
        assert_allclose(output.reward[:, index], output.metrics[f"reward_{name}"])


def test_the_frames_before_a_start_go_on_with_its_velocities(styled, step):
    before, after, output = step
    frames = 5
    links = len(styled.environment.character.link_names)
    assert before.history.shape == (SIZE, frames, links, 7)
    kinematics = before.physics.kinematics
    speed = kinematics.link_linear_velocity
    dt = styled.environment.engine.control_dt
    assert_allclose(before.history[:, -1, :, :3], kinematics.link_position)
    gone = np.diff(before.history[..., :3], axis=1)
    assert_allclose(gone, np.repeat(dt * speed[:, None], frames - 1, axis=1), atol=1e-5)
    assert_allclose(np.linalg.norm(before.history[..., 3:], axis=-1), 1.0, atol=1e-5)
    assert_allclose(after.history[:, :-1], before.history[:, 1:])
    assert output.extras["style"].shape == (SIZE, frames, 7 * links)
    lying = np.asarray(travel(styled.environment.groups[0], output.extras["style"]))
    assert lying.min() < 0.05  # the starts at rest have not moved


def test_one_objective_is_plain_ppo_bit_for_bit(built):
    """`terms: [total]` without groups changes nothing, whether its critic is merged or not."""
    composite = CompositeConfig(task="getup", terms=("total",))
    config = config_with(composite)
    task = with_objectives(config, built, silent)
    objectives = make_discriminator_rewards(task.environment, composite)
    plain = make_learner(built.environment, NETWORK, PPO, 1000)
    same = make_learner(task.environment, NETWORK, PPO, 1000, reward_model=objectives)
    found = []
    for learner, world in ((plain, built.world), (same, task.world)):
        state = jax.jit(learner.init)(world, jax.random.PRNGKey(1))
        iterate = jax.jit(learner.iteration)
        for _ in range(3):
            state, _ = iterate(world, state)
        state = dataclasses.replace(
            state, learner=dataclasses.replace(state.learner, discriminators=None)
        )
        found.append(jax.tree.leaves(state))
    assert len(found[0]) == len(found[1])
    for a, b in zip(*found, strict=True):
        assert_array_equal(np.asarray(a), np.asarray(b))


def test_all_critics_and_the_discriminator_learn(styled):
    objectives = make_discriminator_rewards(styled.environment, STYLE)
    learner = make_learner(styled.environment, NETWORK, PPO, 1000, reward_model=objectives)
    state = jax.jit(learner.init)(styled.world, jax.random.PRNGKey(1))
    iterate = jax.jit(learner.iteration)
    for _ in range(2):
        state, metrics = iterate(styled.world, state)
    assert state.learner.popart.mean.shape == (4,)
    for name in styled.environment.objectives:
        assert np.isfinite(metrics[f"rollout/reward_{name}"])
    assert np.isfinite(metrics["discriminator_style/loss"])
    assert all(bool(jnp.all(jnp.isfinite(x))) for x in jax.tree.leaves(state.learner.policy))


def test_mistakes_name_the_key(character):
    with pytest.raises(ConfigError, match=r"composite\.terms: expected some of .*'height'"):
        CompositeConfig(task="getup", terms=("hight",))
    with pytest.raises(ConfigError, match=r"composite\.goals: expected none while getting up"):
        CompositeConfig(task="getup", goals={"aiming": {}})
    with pytest.raises(ConfigError, match=r"composite\.task: .*'composite', 'getup'"):
        CompositeConfig(task="run")
    bare = assemble(CONFIG, character, getups(character), None, silent)
    natural = CompositeConfig(task="getup", terms=("natural",))
    with pytest.raises(ConfigError, match=r"composite\.terms: natural: .*pose prior"):
        with_objectives(config_with(natural), bare, silent)
