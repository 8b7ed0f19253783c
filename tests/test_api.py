"""The front door, as docs/python.md shows it."""

from __future__ import annotations

import contextlib
import dataclasses
import subprocess
import sys
from collections.abc import Iterator
from types import FrameType
from typing import Any

import numpy as np
import pytest

import getup_jax as gj
from getup_jax.config import ConfigError
from getup_jax.runtime.checkpoint import shipped_policies
from getup_jax.runtime.pytree_store import CheckpointError


@pytest.fixture(scope="module")
def policy() -> gj.Policy:
    return gj.load_policy("flat")


def test_a_shipped_policy_gets_up_in_whole_episodes(policy):
    env = gj.make_env(policy, num_envs=28)
    assert len(env.styles) == 28
    state = env.reset(seed=0)
    assert state.observation.shape == (28, env.observation_size)
    assert policy.act(state.observation).shape == (28, env.action_size)
    verdicts: list[np.ndarray] = []
    for _ in range(round(10.0 / env.control_dt)):
        state, output = env.step(state, policy.act(state.observation))
        verdicts.append(np.asarray(output.episode["success"])[np.asarray(output.done)])
    ended = np.concatenate(verdicts)
    assert len(ended) >= 20
    assert ended.mean() > 0.9


@contextlib.contextmanager
def settings_are_handed_to(files: set[str]) -> Iterator[None]:
    """Adds every file of the package, outside config/, a function of which is given settings."""

    def watch(frame: FrameType, event: str, _: Any) -> None:
        path = frame.f_code.co_filename.partition("/src/getup_jax/")[2]
        if event != "call" or not path or path.startswith("config/"):
            return
        count = frame.f_code.co_argcount + frame.f_code.co_kwonlyargcount
        given = [frame.f_locals.get(n) for n in frame.f_code.co_varnames[:count] if n != "self"]
        if any(type(value).__module__.startswith("getup_jax.config") for value in given):
            files.add(path)

    sys.setprofile(watch)
    try:
        yield
    finally:
        sys.setprofile(None)


def test_evaluate_is_what_the_command_says(policy):
    files: set[str] = set()
    with settings_are_handed_to(files):
        scores = gj.evaluate(policy, gj.Scenario(episodes=28, seed=3))
    assert "envs/getup/build.py" in files
    assert len(files) <= 12, "docs/design.md says 12: hand over what was built of the settings"
    assert scores.episodes == 28
    assert scores.success > 0.9
    with pytest.raises(ConfigError, match="--push: only for policies of the get-up task"):
        gj.evaluate("walk", gj.Scenario(push_ns=9.0))


def test_what_is_not_possible_is_one_line(policy):
    with pytest.raises(ConfigError, match="num_envs: expected a whole number of at least 1, got 0"):
        gj.make_env(policy, num_envs=0)
    with pytest.raises(ConfigError, match="a scenario or training=True, got both"):
        gj.make_env(policy, scenario=gj.Scenario(), training=True)
    known = f"shipped policies: {', '.join(shipped_policies())}; "
    with pytest.raises(CheckpointError, match=known):
        gj.load_policy("falt")
    with pytest.raises(AttributeError, match="has no attribute 'fly'"):
        _ = gj.fly


def test_a_policy_is_trained_and_loaded(tmp_path):
    small = ("ppo.num_envs=4", "ppo.num_steps=2", "ppo.minibatch_size=8", "task.pool_size=64")
    config = gj.load_config("quick", *small, "train.total_steps=16", "network.hidden_sizes=[8]")
    policy = gj.train(config, tmp_path / "run", quiet=True)
    assert policy.steps == 16
    assert policy.config.ppo.num_envs == 4


def test_training_episodes_are_asked_for(policy):
    task = dataclasses.replace(policy.config.task, pool_size=84)
    small = dataclasses.replace(policy, config=dataclasses.replace(policy.config, task=task))
    env = gj.make_env(small, num_envs=2, training=True)
    assert env.config == small.config
    assert env.reset().observation.shape == (2, env.observation_size)
    assert gj.make_env(policy, scenario=gj.Scenario(episodes=2)).config.curriculum is None


def test_importing_the_package_imports_nothing_heavy():
    code = "import sys, getup_jax; dir(getup_jax); sys.exit('jax' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
