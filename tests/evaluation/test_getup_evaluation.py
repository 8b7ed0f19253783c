from __future__ import annotations

import dataclasses
import json

import pytest
from tiny_task import tiny_task

from eval_samples import SMALL, make_task, save_policy
from getup_jax.cli import main
from getup_jax.cli.evaluate import to_scenario
from getup_jax.config.load import load_config
from getup_jax.evaluation import getup
from getup_jax.evaluation.scenario import Scenario
from getup_jax.physics.character import load_character
from getup_jax.release import export
from getup_jax.release.export import CARD
from getup_jax.runtime.checkpoint import MAX_EXPORT_BYTES, load_policy
from getup_jax.runtime.metric_file import MetricsWriter


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory):
    """A run of an untrained policy, with metrics past its only checkpoint."""
    folder = save_policy(tmp_path_factory.mktemp("runs") / "tiny", make_task())
    with MetricsWriter(folder) as writer:
        for iteration, wall_s in ((2, 50.0), (3, 3700.0), (4, 9999.0)):
            writer.write(iteration, 100 * iteration, wall_s, {})
    return folder


def build(config, log, prior=None, choose=None):
    """The tiny task in place of that of the library's motions."""
    assert (config.curriculum, choose) == (None, None)
    return tiny_task(load_character(config.physics), config)


@pytest.fixture(scope="module")
def results(run_folder):
    """What `getup-eval` wrote about the run, and what it printed is in its log."""
    file = run_folder / "out.json"
    options = ["--episodes", "3", "--start-noise", "0.05", "--duration-scale", "0.8,1.2"]
    options += ["--edits", "2"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(getup, "build_task", build)
        command = ["--ckpt", str(run_folder), *options, "--stand-time", "1", "--json", str(file)]
        assert main.eval_main(command) == 0
    return file


def test_eval_writes_scores_policy_and_conditions(results):
    found = json.loads(results.read_text())
    assert found["episodes"] == 3
    assert set(found["per_curve"]) == {"clip", "curve"}
    assert set(found["per_orientation"]) == {"supine"}
    assert found["policy"]["steps"] == 300
    conditions = found["conditions"]
    assert (conditions["start_noise_rad"], conditions["duration_scale"]) == (0.05, [0.8, 1.2])
    assert conditions["edits"] == 2
    assert (conditions["stand_time_s"], conditions["engine"]) == (1.0, "native")
    assert (conditions["drops"], conditions["drop"]) == (None, None)
    assert found["rules"] == {
        "success": {"last_s": 1.0, "lowest_in_last_s": 0.85, "mean_standing": 0.9},
        "early_end": {"task_reward_below": 0.1, "head_gap_below_m": 0.02, "longer_than_s": 0.3},
    }
    assert 0.0 <= found["saturation"] <= 1.0
    assert found["offset_rad"] > 0
    assert found["foot_slip_m_s"] > 0


def test_eval_writes_how_much_of_its_edits_was_done(results):
    found = json.loads(results.read_text())
    assert set(found["control_gain"]) == {"height", "side_angle", "front_angle"}
    for row in found["control_gain"].values():
        assert -2.0 < row["gain"] < 2.0
        assert -1.0 <= row["correlation"] <= 1.0
    assert 0.01 < found["control_gain"]["height"]["asked_rms"] < 0.1
    assert found["success_edits"] == 0.0


def test_edits_of_a_standing_start_are_refused(run_folder, capsys):
    assert main.eval_main(["--ckpt", str(run_folder), "--edits", "2", "--start", "standing"]) == 2
    assert capsys.readouterr().err.startswith("ConfigError: --edits: are of the rise")


def asked(*options: str) -> Scenario:
    """What these options of getup-eval mean."""
    return to_scenario(main.eval_parser().parse_args(options))


def test_the_config_of_an_evaluation_takes_its_starts_from_the_arguments():
    config = load_config(None, ["task.start_noise_rad=0.3", "curriculum.reference_start=0.3"])
    found = getup.evaluation_config(config, asked("--episodes", "7", "--seed", "5"))
    task = found.task
    assert (task.start_noise_rad, found.curriculum, task.stand_start) == (0.0, None, 0.0)
    assert (task.pool_size, task.stand_time_s) == (7, config.task.stand_time_s)
    standing = asked("--start", "standing", "--start-noise", "0.1")
    task = getup.evaluation_config(config, standing).task
    assert (task.stand_start, task.start_noise_rad) == (1.0, 0.1)
    assert standing.kind == 1


def test_bodies_are_dropped_as_asked_and_not_those_of_the_training():
    settings = ["task.limp_share=0.4", "task.fallen_share=0.2", "task.drop_as=any"]
    config = load_config(None, settings)

    def task(*options: str, config=config):
        return getup.evaluation_config(config, asked(*options)).task

    plain = task()
    assert (plain.limp_share, plain.fallen_share, plain.drop_as) == (0.0, 0.0, "limp")
    paper = task("--drops", "paper")
    assert (paper.limp_share, paper.fallen_share, paper.drop_as) == (1.0, 0.0, "paper")
    fallen = task("--drops", "fallen")
    assert (fallen.limp_share, fallen.fallen_share) == (1.0, 1.0)
    alike = load_config(None, [f"task.limp_drops={paper.limp_drops}"])
    assert task("--drops", "paper", config=alike).limp_drops != paper.limp_drops


def test_a_policy_on_another_body_is_said_in_one_line(tmp_path, monkeypatch, capsys):
    task = make_task()
    run_folder = save_policy(tmp_path / "tiny", task, body={"masses": "another", "servos": "too"})
    monkeypatch.setattr(getup, "build_task", build)
    assert main.eval_main(["--ckpt", str(run_folder), "--episodes", "1", "--stand-time", "1"]) == 0
    (line,) = [x for x in capsys.readouterr().out.splitlines() if "warning" in x]
    assert f"{run_folder}/checkpoints/00000003: was trained on a body with other " in line


def test_how_bodies_lie_means_nothing_to_standing_starts(run_folder, capsys):
    assert main.eval_main(["--ckpt", str(run_folder), "--drops", "paper", "--start=standing"]) == 2
    assert capsys.readouterr().err.startswith("ConfigError: --drops: says how bodies lie")


def test_a_push_without_time_to_stand_is_refused_before_anything_is_built(run_folder, capsys):
    assert main.eval_main(["--ckpt", str(run_folder), "--push", "9", "--stand-time", "0.5"]) == 2
    captured = capsys.readouterr()
    assert captured.err.startswith("ConfigError: --push: ")
    assert captured.out == ""


def test_without_a_shipped_policy_the_error_says_what_to_do(monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert main.eval_main(["--ckpt", "nothing"]) == 2
    error = capsys.readouterr().err
    assert error.startswith("CheckpointError: nothing: no such folder; ")
    assert "getup-train configs/flat.yaml" in error


# Policies to ship.


def test_an_export_is_a_small_policy_with_a_card(run_folder, results, tmp_path, capsys):
    out = tmp_path / "assets" / "tiny"
    command = [str(run_folder), str(out), "--eval", str(results), "--machine", "2 cores"]
    command += ["--before", "5 M steps of another policy"]
    assert export.main([*command, "--commit", "abc123"]) == 0
    assert "look at" in capsys.readouterr().out
    loaded = load_policy(out)
    physics = dataclasses.replace(SMALL.physics, engine="auto")  # whatever the training had
    assert loaded.config == dataclasses.replace(SMALL, physics=physics)
    assert loaded.prior is not None
    assert not (out / "learner").exists()
    assert sum(file.stat().st_size for file in out.rglob("*") if file.is_file()) < MAX_EXPORT_BYTES
    card = (out / CARD).read_text()
    for fact in ("| control steps | 300 |", "| wall time | 1 h 01 min |", "| commit | abc123 |"):
        assert fact in card
    assert "| machine | 2 cores |" in card
    assert "| started from | 5 M steps of another policy |" in card
    assert (
        "Lying starts, seed 0, engine native, joint noise 0.05 rad, durations T x U(0.8, 1.2)"
        in card
    )
    assert "| all | 0.0% (0.0% - 56.1%) |" in card
    assert "Curves that succeed in less than 80%: clip (0%), curve (0%)." in card


def test_a_card_has_a_row_a_region(run_folder, results, tmp_path):
    found = json.loads(results.read_text())
    found["conditions"]["terrain_seed"] = 7
    found["conditions"]["drops"] = "paper"
    found["per_region"] = {"hard": found | {"success": 0.25}}
    found["per_ground"] = {"slope 20-30°": found | {"success": 0.125}}
    file = tmp_path / "regions.json"
    file.write_text(json.dumps(found))
    card = (export.export(run_folder, tmp_path / "tiny", [file]) / CARD).read_text()
    assert "U(0.8, 1.2), ground of seed 7, bodies as of --drops paper" in card
    assert "| slope 20-30° | 12.5% (0.0% - 56.1%) |" in card
    assert "| region hard | 25.0% (0.0% - 56.1%) |" in card


def test_an_export_can_be_made_again_and_says_what_is_unknown(run_folder, tmp_path):
    for _ in range(2):
        out = export.export(load_policy(run_folder).path, tmp_path / "tiny")
    card = (out / CARD).read_text()
    assert "| machine | unknown |" in card
    assert "Not evaluated yet." in card
    assert "started from" not in card


def test_results_of_another_policy_are_refused(run_folder, results, tmp_path, capsys):
    other = json.loads(results.read_text())
    other["policy"]["steps"] = 1
    file = tmp_path / "other.json"
    file.write_text(json.dumps(other))
    assert main.export_main([str(run_folder), str(tmp_path / "out"), "--eval", str(file)]) == 2
    assert "evaluate what is exported" in capsys.readouterr().err
    file.write_text("{}")
    assert main.export_main([str(run_folder), str(tmp_path / "out"), "--eval", str(file)]) == 2
    assert "expected a file of getup-eval --json" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
