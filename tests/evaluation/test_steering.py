"""A script steers untrained policies: what is told reaches them, and switches keep the episode."""

from __future__ import annotations

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

from getup_jax.cli.main import eval_main
from getup_jax.config import ConfigError
from getup_jax.evaluation.steering import load_players, run_script
from getup_jax.evaluation.steering_script import Command, Script
from getup_jax.runtime.checkpoint import load_policy
from steering_samples import config_with, save


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Two checkpoints: one with a place to go to, one that also aims."""
    base = tmp_path_factory.mktemp("steered")
    one = save(base / "walk", config_with({"target_location": {}}))
    two = save(base / "aim", config_with({"target_location": {}, "aiming": {}}))
    return one, two


def test_targets_are_held_and_a_switch_keeps_the_episode(folders):
    one, two = folders
    here = {"place": (0.0, 0.0), "within_s": 0.2}
    there = {"place": (5.0, 1.0), "within_s": 4.0}
    script = Script(
        0.6,
        (
            Command(0.0, None, {"target_location": here}),
            Command(0.2, str(two), {"aiming": {"yaw_deg": 90.0, "pitch_deg": 0.0}}),
            Command(0.4, None, {"target_location": there}),
        ),
    )
    loaded = load_policy(one)
    players = load_players(loaded, loaded.config, script, lambda text: None)
    course = run_script(players, script, seed=0)
    assert course.qpos.shape == (18, 35)
    # the episode goes on: no jump of the pose where the policy changes
    assert np.abs(np.diff(course.qpos[:, :3], axis=0)).max() < 0.1
    place = np.array([shown[0].position[:2] for shown in course.markers])
    assert_allclose(place[:12], 0.0)  # held past its time
    assert_allclose(place[12:], [[5.0, 1.0]] * 6)
    counts = [len(shown) for shown in course.markers]
    assert counts == [1] * 6 + [2] * 12
    assert_allclose(course.markers[8][1].reach, [0.0, 1.0, 0.0], atol=1e-6)
    first, aim, second = course.results
    assert (first["goal"], aim["goal"]) == ("target_location", "aiming")
    assert first["reached_after_s"] == pytest.approx(1 / 30)  # it starts there
    assert second["reached_after_s"] is None
    assert 0.0 < aim["reward"] < 1.0
    assert course.lines[0].startswith("0.0 s target_location: place (0.0, 0.0)")
    assert "aiming: yaw_deg 90.0" in course.lines[-1]


def test_the_command_writes_what_came_of_it(folders, tmp_path, capsys):
    file, result = tmp_path / "go.yaml", tmp_path / "out.json"
    file.write_text("duration_s: 0.2\ncommands: [{at_s: 0, target_location: {place: [0, 0]}}]\n")
    arguments = ["--ckpt", str(folders[0]), "--script", str(file), "--json", str(result)]
    assert eval_main(arguments) == 0
    assert "reached after 0.0 s" in capsys.readouterr().out
    content = json.loads(result.read_text())
    assert content["fell_s"] is None
    assert content["results"][0]["order"]["place"] == [0.0, 0.0]


def test_a_policy_that_cannot_do_what_is_asked_is_an_error(folders, tmp_path):
    one, _ = folders
    loaded = load_policy(one)

    def players_for(*commands: Command):
        return load_players(loaded, loaded.config, Script(1.0, commands), lambda text: None)

    aim = {"aiming": {"yaw_deg": 0.0, "pitch_deg": 0.0}}
    with pytest.raises(ConfigError, match=r"at 0 s: aiming: .*has the goals: target_location"):
        players_for(Command(0.0, None, aim))
    other = save(tmp_path / "soft", config_with({"target_location": {}}, gain_scale=0.5))
    with pytest.raises(ConfigError, match="was trained with other physics"):
        players_for(Command(0.0, str(other), {}))
    ball = save(tmp_path / "ball", config_with({"juggling": {}}))
    with pytest.raises(ConfigError, match="other balls or rackets"):
        players_for(Command(0.0, str(ball), {}))
