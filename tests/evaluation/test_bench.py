from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from tiny_task import tiny_task

from eval_samples import make_task, run, save_policy
from getup_jax.cli import bench as command
from getup_jax.cli.main import bench_main
from getup_jax.config import ConfigError, PhysicsConfig
from getup_jax.config.load import load_config
from getup_jax.evaluation import bench, bench_report, getup
from getup_jax.evaluation.bench import Cell, Result
from getup_jax.evaluation.metrics import wilson
from getup_jax.evaluation.scenario import Scenario, make_plan
from getup_jax.evaluation.verdicts import RULES
from getup_jax.physics.character import load_character


def test_all_styles_have_every_push_as_often():
    for suite in bench.suites().values():
        assert suite.episodes == bench.STYLES * len(bench.PUSHES_NS) * bench.ROUNDS
        assert not suite.scenario.early_termination
    (quick,) = bench.suites(quick=True).values()
    plan = make_plan(quick.scenario, quick.episodes, bench.STYLES, 2)
    push = np.linalg.norm(plan.impulse, axis=-1).round(3)
    for style in range(bench.STYLES):
        assert sorted(push[plan.getup == style]) == [0.0, 20.0]


def test_in_all_regions_every_push_comes_as_often():
    scenario = bench.suites()["slopes"].scenario
    plan = make_plan(scenario, 336, bench.STYLES, 12, regions=4)
    push, region = np.linalg.norm(plan.impulse, axis=-1).round(3), np.arange(336) % 4
    for index in range(4):
        assert np.unique(push[region == index], return_counts=True)[1].tolist() == [28] * 3


def test_the_task_is_the_benchmarks_and_the_policys_own_part_is_its_own():
    mine = load_config(
        "flat",
        ["task.filter=0.5", "task.lookahead_s=[0.0, 0.4]", "task.curve_match_rad=0.1",
         "task.stand_time_s=1", "motion.source=[mine]"],
    )  # fmt: skip
    found = bench.config_of(mine, irregular=False)
    assert (found.task.filter, found.task.lookahead_s) == (0.5, (0.0, 0.4))
    assert (found.task.curve_match_rad, found.task.stand_time_s) == (0.52, 3.0)
    assert (found.motion.source, found.terrain) == (("authored",), None)
    slopes = bench.config_of(mine, irregular=True)
    assert slopes.terrain is not None
    assert slopes.terrain.relief_gain == 1.0  # it was trained without a map that is sharpened
    terrain = load_config("terrain")
    again = bench.config_of(terrain, irregular=True).terrain
    assert again is not None
    assert again.relief_gain == terrain.terrain.relief_gain
    assert bench.config_of(terrain, irregular=False).terrain is None


def test_nothing_ends_early():
    scenario = bench.suites(quick=True)["own"].scenario
    task = getup.evaluation_config(load_config("flat"), scenario).task
    assert task.terminate_after_s == 3600.0
    plain = dataclasses.replace(scenario, early_termination=True)
    assert getup.evaluation_config(load_config("flat"), plain).task.terminate_after_s == 0.3


def test_cells_are_by_push_and_hold_all_episodes():
    task = make_task()
    scenario = Scenario(start="standing", pushes_ns=(0.0, 30.0), early_termination=False)
    episodes = run(task, scenario, 4)
    cells = list(bench.cells_of("own", episodes, scenario))
    assert [(cell.ground, cell.push_ns, cell.episodes) for cell in cells] == [
        ("plane", 0.0, 2), ("plane", 30.0, 2),
    ]  # fmt: skip
    assert all(0 <= cell.successes[rule] <= 2 for cell in cells for rule in RULES)
    pushed = episodes.trace.pushed.any(axis=0)
    assert pushed.tolist() == [False, False, True, True]


CELLS = [
    Cell("own", "plane", 0.0, 28, dict.fromkeys(RULES, 21)),
    Cell("own", "plane", 20.0, 28, dict.fromkeys(RULES, 7)),
]
RESULT = Result("mine", {"outside": True}, True, CELLS, {"own": {"jitter": float("nan")}})


def test_totals_are_of_all_that_is_alike():
    assert RESULT.total().successes["host"] == 28
    assert RESULT.total(push_ns=20.0).episodes == 28
    assert RESULT.total(push_ns=20.0).share("ours") == (0.25, *wilson(7, 28))


def test_the_json_and_the_table_have_every_cell():
    found = json.loads(json.dumps(bench_report.to_json(RESULT), allow_nan=False))
    assert found["benchmark"]["version"] == bench.VERSION
    assert found["all"]["thesis"]["share"] == 0.5
    assert [cell["push_ns"] for cell in found["cells"]] == [0.0, 20.0]
    assert found["cells"][0]["success"]["host"]["share"] == 0.75
    assert found["motion"]["own"]["jitter"] is None
    text = bench_report.table(RESULT)
    assert " 75% (57%-87%)" in text
    assert " 50% (37%-63%)" in text


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("walk", "walk: is of composite motion; expected a policy that gets up"),
        ("nothing", "nothing: no such folder"),
        ("no_such_module:f", "no_such_module:f: cannot be imported"),
    ],
)
def test_what_cannot_enter_is_said_in_one_line(name, message, capsys):
    assert bench_main([name, "--quick"]) == 2
    captured = capsys.readouterr()
    assert message in captured.err
    assert captured.err.count("\n") == 1


def test_a_policy_of_another_body_cannot_enter():
    with pytest.raises(ConfigError, match=r"trained with physics.gain_scale=2.0.* has 1.5"):
        bench._check_physics("mine", PhysicsConfig(gain_scale=2.0))
    bench._check_physics("mine", PhysicsConfig(engine="mjx", threads=3))


def small_suites(monkeypatch: pytest.MonkeyPatch, *names: str) -> None:
    """The tiny task with two episodes a suite, in place of the library's."""

    def build(config, log, prior=None, choose=None):
        return tiny_task(load_character(config.physics), config)

    monkeypatch.setattr(getup, "build_task", build)
    scenario = Scenario(episodes=2, pushes_ns=(0.0,), early_termination=False, seed=1)
    small = {name: bench.Suite(False, "tiny", scenario) for name in names}
    monkeypatch.setattr(bench, "suites", lambda quick=False: small)
    monkeypatch.setattr(bench_report, "suites", lambda quick=False: small)


def test_the_command_runs_a_checkpoint_and_writes_it(tmp_path, monkeypatch, capsys):
    """All through the command, with the tiny task in place of the library's."""
    folder = save_policy(tmp_path / "tiny", make_task())
    small_suites(monkeypatch, "own")
    assert bench_main([str(folder), "--json", str(tmp_path / "out.json")]) == 0
    found = json.loads((tmp_path / "out.json").read_text())
    assert found["policy"]["name"] == str(folder)
    assert (found["policy"]["steps"], found["policy"]["outside"]) == (300, False)
    assert found["cells"][0]["episodes"] == 2
    assert found["missing"] == []
    text = capsys.readouterr().out
    assert "2/2 episodes" in text
    assert "HoST" in text
    assert "not run" not in text
    assert command.bench_command.__doc__


def test_what_has_been_run_when_it_is_interrupted_is_kept(tmp_path, monkeypatch, capsys):
    folder = save_policy(tmp_path / "tiny", make_task())
    small_suites(monkeypatch, "own", "limp")
    calls = []

    def interrupted(*args):
        calls.append(args)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return getup.run(*args)

    monkeypatch.setattr(bench, "run", interrupted)
    assert bench_main([str(folder), "--json", str(tmp_path / "out.json")]) == 130
    found = json.loads((tmp_path / "out.json").read_text())
    assert [cell["starts"] for cell in found["cells"]] == ["own"]
    assert found["missing"] == ["limp"]
    assert "not run: limp" in capsys.readouterr().out
