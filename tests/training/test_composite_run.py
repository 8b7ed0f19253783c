"""A composite policy from `getup-train` to `getup-eval`, by the commands of getting up."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from numpy.testing import assert_allclose

from getup_jax.cli.main import eval_main, train_main
from getup_jax.config import ConfigError
from getup_jax.config.load import load_config
from getup_jax.envs.composite.build import build_composite
from getup_jax.envs.composite.reference_windows import link_poses
from getup_jax.evaluation.composite import score_composite
from getup_jax.evaluation.composite_rollout import CompositeEpisodes
from getup_jax.runtime.metric_file import read_metrics

SMALL = [
    "network.hidden_sizes=[8]",
    "network.gru_size=8",
    "composite.discriminator.gru_size=8",
    "composite.discriminator.hidden_sizes=[8]",
    "composite.discriminator.minibatch_size=16",
    "composite.episode_s=1.0",
    "composite.warm_start=false",  # has tests of its own, and takes a minute
    "ppo.num_envs=8",
    "ppo.num_steps=4",
    "ppo.minibatch_size=16",
    "ppo.epochs=1",
    "train.total_steps=96",
    "train.log_every=1",
]


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("composite") / "run"
    arguments = ["composite_wave_squat", *SMALL, "--run", str(folder), "--quiet"]
    assert train_main(arguments) == 0
    return folder


def test_metrics_have_every_objective(run_folder):
    rows = read_metrics(run_folder)
    assert [row["iteration"] for row in rows] == [1, 2, 3]
    for name in ("upper", "lower"):
        for key in (
            f"rollout/reward_{name}",
            f"rollout/pose_gap_{name}_m",
            f"discriminator_{name}/loss",
        ):
            assert np.isfinite(rows[-1][key])


def test_evaluation_reports_the_error_of_every_group(run_folder, tmp_path, capsys):
    result = tmp_path / "eval.json"
    assert eval_main(["--ckpt", str(run_folder), "--episodes", "3", "--json", str(result)]) == 0
    printed = capsys.readouterr().out
    assert "upper" in printed
    assert "lower" in printed
    scores = json.loads(result.read_text())
    errors = scores["imitation_error_m"]
    assert 0.0 < errors["upper"]["mean"] < 2.0
    means = [errors[name]["mean"] for name in ("upper", "lower")]
    assert_allclose(scores["ratio"], max(means) / min(means))
    assert scores["episodes"] == 3


@pytest.mark.slow
def test_a_policy_is_trained_on_top_of_a_meta_policy(run_folder, tmp_path, capsys):
    folder, change = tmp_path / "on_top", f"composite.meta={run_folder}"
    arguments = ["composite_wave_squat", *SMALL, change, "--run", str(folder), "--quiet"]
    assert train_main(arguments) == 0
    assert np.isfinite(read_metrics(folder)[-1]["loss/policy"])
    assert eval_main(["--ckpt", str(folder), "--episodes", "2"]) == 0
    printed = capsys.readouterr().out
    # the first weights are near their start, 0.88
    assert re.search(r"lower +weight of the meta policy 0\.(8[5-9]|9[01])", printed)


def test_options_of_getting_up_are_refused(run_folder, capsys):
    assert eval_main(["--ckpt", str(run_folder), "--push", "20"]) == 2
    assert "--push: only for policies of the get-up task" in capsys.readouterr().err


def test_a_character_that_plays_the_clips_has_no_error():
    """The upper body of one clip on the legs of the other, moved about: 0 m for both."""
    config = load_config("composite_wave_squat", SMALL)
    task = build_composite(config, lambda text: None)
    character = task.environment.character
    squat = task.clips["lower"][0].qpos[:-1]
    wave = task.clips["upper"][0].qpos[:-1]
    frames = 150
    qpos = squat[(np.arange(frames) + 7) % len(squat)].copy()
    of_upper = np.isin(character.joint_link, task.environment.groups[0].links)
    qpos[:, 7:][:, of_upper] = wave[(np.arange(frames) + 3) % len(wave), 7:][:, of_upper]
    qpos[:, 0] += 2.0
    position, quaternion = link_poses(qpos, character)
    no_goals = (np.zeros((1, frames, 0)), np.zeros((1, 0)))
    fell = np.zeros((1, frames), bool)
    episodes = CompositeEpisodes(position[None], quaternion[None], qpos[None], fell, *no_goals)
    scores = score_composite(task, episodes)
    for group in scores.groups.values():
        assert_allclose(group.mean, 0.0, atol=1e-5)
        assert_allclose(group.travel, 1.0, atol=0.05)
    still = CompositeEpisodes(
        np.repeat(position[None, :1], frames, axis=1),
        np.repeat(quaternion[None, :1], frames, axis=1),
        qpos[None],
        ~fell,
        *no_goals,
    )
    worse = score_composite(task, still)
    assert worse.groups["lower"].mean > 0.05
    assert worse.groups["lower"].travel == 0.0
    assert worse.fall_share == 1.0


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("composite.groups.lower.clips=[sqat]", r"groups\.lower\.clips: no clip 'sqat'.*squat"),
        ("composite.groups.lower.links=[shin_l]", r"pelvis.*in no group"),
        ("composite.start_group=legs", r"composite\.start_group.*'upper', 'lower'"),
        ("terrain={}", r"terrain: expected null with composite motion"),
        ("composite.discriminator.minibatch_size=100", r"minibatch_size: .*a divisor of .*4096"),
        ("composite.groups.upper.frame=rot", r"groups\.\*\.frame: .*'heading', 'root'"),
        ("composite.groups.upper.history=9", r"groups\.upper\.history: .*from 0 to 3, got 9"),
        ("composite.weights={arms: 0.5}", r"composite\.weights: expected one of each of upper"),
    ],
)
def test_mistakes_of_a_config(override, message):
    with pytest.raises(ConfigError, match=message):
        build_composite(load_config("composite_wave_squat", [override]), lambda text: None)
