from __future__ import annotations

import dataclasses
from pathlib import Path

import jax
import pytest
from tiny_composite import CONFIG as COMPOSITE
from tiny_task import CONFIG, getups

from getup_jax.config import NetworkConfig
from getup_jax.editor.simulate import editor_config
from getup_jax.editor.steer.policies import Policies, choose
from getup_jax.editor.steer.recovery import GetUp
from getup_jax.envs.getup.build import BuiltTask, assemble
from getup_jax.physics.character import load_character
from getup_jax.rl.learner import make_learner
from getup_jax.runtime.checkpoint import load_policy, save_learner
from steering_samples import config_with, save

GETUP = dataclasses.replace(
    CONFIG,
    physics=dataclasses.replace(COMPOSITE.physics, character="humanoid28_getup"),
    network=NetworkConfig(hidden_sizes=(8,)),
    prior=None,
)


@pytest.fixture(scope="session")
def policies(tmp_path_factory) -> Policies:
    """Two untrained policies, compiled: one with a place to go to, one that aims as well."""
    base = tmp_path_factory.mktemp("steer")
    walk = str(save(base / "walk", config_with({"target_location": {}})))
    aim = str(save(base / "aim", config_with({"target_location": {}, "aiming": {}})))
    made = choose(walk, load_policy(walk), [aim], None)
    made.build(lambda text: None)
    return made


@pytest.fixture(scope="session")
def getup_task() -> BuiltTask:
    """The body of composite motion, with a style to get up in."""
    character = load_character(GETUP.physics)
    styles = [style for style in getups(character) if style.clip is not None]
    return assemble(editor_config(GETUP), character, styles, None, lambda text: None)


@pytest.fixture(scope="session")
def getup_path(getup_task, tmp_path_factory) -> Path:
    """A policy that gets this body up, or rather does not: it is untrained."""
    learner = make_learner(getup_task.environment, GETUP.network, GETUP.ppo, 100)
    policy = jax.jit(learner.init_learner)(jax.random.key(0)).policy
    item = {"policy": policy, "prior": None}
    return save_learner(tmp_path_factory.mktemp("getup"), 1, policy, GETUP, item)


@pytest.fixture(scope="session")
def getup(getup_task, getup_path) -> GetUp:
    return GetUp.of(getup_task, load_policy(getup_path))
