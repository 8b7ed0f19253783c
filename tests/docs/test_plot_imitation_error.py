from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import plot_imitation_error as plot
import pytest


def entry(steps: int, error: float, reward: float = 0.5) -> dict:
    errors = {"upper": {"mean": error, "std": 0.0, "travel": 1.0}}
    goals = {"aiming": {"reward": reward, "success": None}}
    return {
        "checkpoint": f"{steps:08d}",
        "steps": steps,
        "imitation_error_m": errors,
        "goals": goals,
        "episodes": 16,
    }


def test_runs_are_compared_where_all_of_them_are():
    runs = [
        [entry(10, 0.5), entry(20, 0.3), entry(30, 0.1)],
        [entry(15, 0.5), entry(25, 0.3)],
    ]
    steps, mean, spread = plot.averaged(runs, lambda e: e["imitation_error_m"]["upper"]["mean"])
    np.testing.assert_allclose(steps, [15, 20, 25])
    np.testing.assert_allclose(mean, [0.45, 0.35, 0.25])
    np.testing.assert_allclose(spread, 0.05)


@pytest.mark.parametrize(
    ("text", "name", "folders"),
    [("runs/a", "a", ["runs/a"]), ("with MO=runs/a,runs/b", "with MO", ["runs/a", "runs/b"])],
)
def test_names(text, name, folders):
    assert plot.split_name(text) == (name, [Path(folder) for folder in folders])


def test_only_new_checkpoints_are_played(tmp_path):
    (tmp_path / plot.SCORES).write_text(json.dumps([entry(10, 0.5)]))
    for name in ("00000010", "00000030", "00000020"):
        folder = tmp_path / "checkpoints" / name
        folder.mkdir(parents=True)
        (folder / "checkpoint.json").write_text("{}")
    asked = []

    def play(folder, paths, number):
        asked.extend(path.name for path in paths)
        return [entry(int(path.name), 0.1) for path in paths]

    found = plot.evaluated(tmp_path, 16, play)
    assert asked == ["00000020", "00000030"]
    assert [e["steps"] for e in found] == [10, 20, 30]
    assert len(plot.evaluated(tmp_path, 16, play)) == 3
    assert len(asked) == 2


def test_the_command_draws_what_is_known(tmp_path, capsys):
    for name, top in (("one", 0.4), ("two", 0.2)):
        (tmp_path / name).mkdir()
        found = [entry(10, top), entry(20, top / 2)]
        (tmp_path / name / plot.SCORES).write_text(json.dumps(found))
    out = tmp_path / "plot.png"
    runs = f"MO={tmp_path / 'one'},{tmp_path / 'two'}"
    assert plot.main([runs, "--goals", "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "upper: error (m), MO: 0.150 +- 0.050 at 20 steps" in printed
    assert "aiming: reward, MO: 0.500" in printed
    assert out.stat().st_size > 5000


def test_a_folder_without_checkpoints_is_an_error(tmp_path, capsys):
    assert plot.main([str(tmp_path)]) == 2
    assert "no checkpoints" in capsys.readouterr().err
