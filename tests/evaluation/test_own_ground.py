from __future__ import annotations

import argparse

import pytest

from getup_jax.config import Config, ConfigError, TerrainConfig
from getup_jax.evaluation.getup import evaluation_config
from getup_jax.evaluation.own_ground import OwnGround, own_ground
from getup_jax.evaluation.scenario import Scenario

ON_TERRAIN = Config(terrain=TerrainConfig())


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("hills.npy:24", OwnGround("hills.npy", 24.0)),
        ("a/hills.png:24:2.5", OwnGround("a/hills.png", 24.0, 2.5)),
        ("C:hills.npy:24", OwnGround("C:hills.npy", 24.0)),
    ],
)
def test_file_side_and_height(text, expected):
    assert own_ground(text) == expected


@pytest.mark.parametrize("text", ["hills.png", "hills.png:-1", ":24", "hills.png:wide", "a:nan"])
def test_what_is_no_ground_is_said(text):
    with pytest.raises(argparse.ArgumentTypeError, match=r"such as hills\.png:24:2"):
        own_ground(text)


def test_it_takes_the_place_of_the_training_s_ground():
    config = evaluation_config(ON_TERRAIN, Scenario(ground=OwnGround("hills.png", 24.0, 2.0)))
    terrain = config.terrain
    assert terrain is not None
    assert (terrain.heights, terrain.region_size_m, terrain.height_m) == ("hills.png", 24.0, 2.0)
    assert terrain.drops != ON_TERRAIN.terrain.drops  # bodies fall anew


@pytest.mark.parametrize(
    ("config", "scenario", "message"),
    [
        (Config(), Scenario(ground=OwnGround("a.npy", 24.0)), "--ground: the policy was trained"),
        (ON_TERRAIN, Scenario(ground=OwnGround("a.npy", 24.3)), "region_size_m: expected a multi"),
        (
            ON_TERRAIN,
            Scenario(ground=OwnGround("a.npy", 24.0), terrain_seed=3),
            "--terrain-seed: the ground is that of a.npy",
        ),
    ],
)  # fmt: skip
def test_a_ground_that_does_not_fit_the_policy_is_said(config, scenario, message):
    with pytest.raises(ConfigError, match=message):
        evaluation_config(config, scenario)
