"""An editor of the tiny task with an untrained policy, and curves for it."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
from tiny_task import getups, neutral_prior

from eval_samples import SMALL, save_policy
from getup_jax.config import Config, TerrainConfig
from getup_jax.editor.options import edit_parser
from getup_jax.editor.simulate import Motion, Simulator, editor_config
from getup_jax.editor.starts import ANYWHERE, Place
from getup_jax.envs.getup.build import BuiltTask, assemble
from getup_jax.motion.io.curve_file import CurveFile
from getup_jax.physics.character import load_character
from getup_jax.runtime.checkpoint import CHECKPOINTS, LoadedPolicy, load_policy, save_learner

SECONDS = 0.9


def make_curve(end_height: float = 1.4, start: str = "clip") -> CurveFile:
    """A rise from the back in a straight line."""
    share = np.linspace(0.0, 1.0, 9)[:, None]
    first, last = np.array([0.12, 90.0, 1.0]), np.array([end_height, 90.0, 90.0])
    return CurveFile("line", "other", start, (SECONDS,), first + share * (last - first))


def whole_motion(simulator: Simulator, curve: CurveFile, place: Place = ANYWHERE) -> Motion:
    """What comes last of a simulation."""
    *_, motion = simulator.run(curve, place)
    assert isinstance(motion, Motion)
    return motion


def make_task(config: Config) -> BuiltTask:
    """The tiny task's styles with a motion."""
    character = load_character(config.physics)
    styles = [getup for getup in getups(character) if getup.clip is not None]
    return assemble(config, character, styles, neutral_prior(character), lambda text: None)


def make_simulator(folder: Path) -> tuple[Simulator, LoadedPolicy]:
    """A simulator of an untrained policy that is written below the folder, and the policy."""
    config = editor_config(SMALL)
    task = make_task(config)
    loaded = load_policy(save_policy(folder / "run", task, SMALL))
    return Simulator.of(config, task, loaded), loaded


def make_ground_simulator(loaded: LoadedPolicy, terrain: TerrainConfig) -> Simulator:
    """The same policy on irregular ground with two places a region."""
    config = editor_config(SMALL)
    rows = dataclasses.replace(config.task, pool_size=8)
    config = dataclasses.replace(config, task=rows, terrain=terrain)
    return Simulator.of(config, make_task(config), loaded)


def save_ground_policy(folder: Path, terrain: TerrainConfig) -> Path:
    """The shipped policy as one of irregular ground, which it was not trained on, as a run."""
    shipped = load_policy(edit_parser().get_default("ckpt"))
    config = dataclasses.replace(shipped.config, terrain=terrain)
    item = {"policy": shipped.policy, "prior": shipped.prior}
    save_learner(folder / CHECKPOINTS, 1, shipped.policy, config, item)
    return folder
