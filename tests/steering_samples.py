"""Untrained policies of one character, as checkpoints that can be switched between."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import jax
import numpy as np
from tiny_composite import CONFIG, GROUPS

from getup_jax.config import Config
from getup_jax.envs.composite.build import build_composite
from getup_jax.rl.learner import make_learner
from getup_jax.runtime.checkpoint import save_learner

STATE = {"none": np.zeros(1)}  # of a training that nobody goes on with
CLIPS = {"upper": ("wave",), "lower": ("squat",)}


def config_with(goals: dict, **physics) -> Config:
    groups = {name: dataclasses.replace(group, clips=CLIPS[name]) for name, group in GROUPS.items()}
    composite = dataclasses.replace(CONFIG.composite, groups=groups, goals=goals)
    changed = dataclasses.replace(CONFIG.physics, **physics)
    return dataclasses.replace(CONFIG, composite=composite, physics=changed)


def save(folder: Path, config: Config) -> Path:
    built = build_composite(config, lambda text: None)
    learner = make_learner(built.environment, config.network, config.ppo, 100)
    policy = jax.jit(learner.init_learner)(jax.random.key(3)).policy
    return save_learner(folder, 1, STATE, config, {"policy": policy, "prior": None})
