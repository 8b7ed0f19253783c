from __future__ import annotations

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from getup_jax.cli import main
from getup_jax.cli.search import search_config
from getup_jax.config import Config, ConfigError, CurriculumConfig, TaskConfig, TerrainConfig
from getup_jax.envs.getup.build import BuiltTask
from getup_jax.trajectory_search.finder import Finder
from getup_jax.trajectory_search.sampling import Settings

SETTINGS = Settings(steps=3, spread_rad=0.2, pose=0.0, memory=0.9)


@pytest.fixture(scope="module")
def resting(built: BuiltTask) -> BuiltTask:
    """The first style's curve stays on the floor, so that following it is easy."""
    points = np.tile(built.getups[0].points[:1], (len(built.getups[0].points), 1))
    getups = tuple(dataclasses.replace(getup, points=points) for getup in built.getups)
    world = built.world.replace(points=jnp.asarray(np.stack([points, points]), jnp.float32))
    return dataclasses.replace(built, world=world, getups=getups)


@pytest.fixture(scope="module")
def path(resting):
    return Finder(resting, children=128).find(0, SETTINGS, seed=0)


def test_found_states_begin_lying_and_go_on_to_the_end(path, built):
    assert path.finished
    assert path.time.max() > 0.8 * built.getups[0].duration
    assert (path.task_reward > 0.5).all()
    first = path.qpos[path.time == 0.0]
    assert (first[:, 2] < 0.2).all()
    assert (np.diff(path.time) >= 0).all()
    windows = path.time / (SETTINGS.steps / 30)
    np.testing.assert_allclose(windows, windows.round(), atol=1e-6)
    assert path.time.max() <= built.getups[0].duration
    assert path.qpos.shape[1:] == (56,)
    assert path.action.shape[1:] == (built.environment.action_size,)
    assert np.isfinite(path.qpos).all()


def test_the_same_seed_finds_the_same(path, resting):
    again = Finder(resting, children=128).find(0, SETTINGS, seed=0)
    np.testing.assert_array_equal(again.qpos, path.qpos)


def test_the_search_uses_lying_starts_on_flat_ground():
    config = Config(
        task=TaskConfig(limp_share=0.5), curriculum=CurriculumConfig(prioritisation=0.5)
    )
    found = search_config(config, seed=1)
    assert (found.task.stand_start, found.task.limp_share, found.curriculum) == (0.0, 0.0, None)
    with pytest.raises(ConfigError, match="flat ground"):
        search_config(dataclasses.replace(config, terrain=TerrainConfig()), seed=1)


@pytest.mark.parametrize(
    ("option", "expected"),
    [
        (["--rounds", "9"], "--rounds: expected 1 to 3, got 9"),
        (["--children", "100"], "--children: expected a multiple of 64"),
    ],
)
def test_options_that_cannot_be_are_refused(option, expected, capsys, tmp_path):
    assert main.search_main(["flat", "--out", str(tmp_path), *option]) == 2
    assert expected in capsys.readouterr().err
