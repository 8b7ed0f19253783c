from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from getup_jax.config import (
    CompositeConfig,
    Config,
    ConfigError,
    DiscriminatorConfig,
    GroupConfig,
    PPOConfig,
)
from getup_jax.runtime import processes
from getup_jax.runtime.processes import ProcessError
from getup_jax.runtime.run_folder import RunError, prepare
from getup_jax.training import spread

CONFIG = Config(ppo=PPOConfig(num_envs=12, num_steps=4, minibatch_size=24))


def composite(minibatch_size: int) -> Config:
    discriminator = DiscriminatorConfig(minibatch_size=minibatch_size)
    groups = {"all": GroupConfig(links=("all",))}
    composite = CompositeConfig(groups=groups, discriminator=discriminator)
    return dataclasses.replace(CONFIG, composite=composite)


@pytest.mark.parametrize("devices", [1, 2, 3, 4, 6, 12])
def test_what_divides_is_accepted(devices):
    spread.check_divides(CONFIG, devices)


@pytest.mark.parametrize(
    ("config", "devices", "text"),
    [
        (CONFIG, 8, r"ppo.num_envs: expected a multiple .* 8, got 12; set ppo.num_envs=16"),
        (CONFIG, 5, "ppo.num_envs=15"),
        (composite(6), 4, r"composite.discriminator.minibatch_size: expected .* got 6; set "),
    ],
)
def test_what_does_not_divide_is_named(config, devices, text):
    with pytest.raises(ConfigError, match=text):
        spread.check_divides(config, devices)


def as_process_1(monkeypatch, change: int) -> None:
    """Let another process answer as this one, but for `change` of its values."""

    def gathered(values):
        other = list(values)
        other[change] += 1
        return np.asarray([values, other], np.int64)

    monkeypatch.setattr(processes, "gathered", gathered)


@pytest.mark.parametrize(
    ("change", "error", "text"),
    [
        (0, ProcessError, "process 1 has other settings than process 0"),
        (1, RunError, "process 1 does not see what process 0 wrote"),
    ],
)
def test_processes_must_agree(monkeypatch, tmp_path, change, error, text):
    prepare(tmp_path, CONFIG, False, print).close()
    spread.check_shared(CONFIG, tmp_path)
    as_process_1(monkeypatch, change)
    with pytest.raises(error, match=text):
        spread.check_shared(CONFIG, tmp_path)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (0, "process 1 has made other start states than process 0"),
        (1, "process 1 resumes at iteration 8, process 0 at 7"),
    ],
)
def test_processes_must_begin_alike(monkeypatch, change, text):
    world = {"pool": np.zeros(3)}
    spread._check_same(world, 7)
    as_process_1(monkeypatch, change)
    with pytest.raises(ProcessError, match=text):
        spread._check_same(world, 7)
