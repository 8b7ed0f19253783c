from __future__ import annotations

import json
import math

import numpy as np
import plot_return_rate as plot
import pytest


def rows(values: list[float], opened: list[float]) -> list[dict]:
    return [
        {"steps": 10 * (i + 1), "iteration": i, plot.METRIC: value, plot.OPENED: o}
        for i, (value, o) in enumerate(zip(values, opened, strict=True))
    ]


def test_a_curve_leaves_out_what_is_not_known():
    steps, value, opened = plot.curve(rows([0.1, math.nan, 0.3], [1, 1, 1]), plot.METRIC)
    np.testing.assert_array_equal(steps, [10, 30])
    np.testing.assert_array_equal(value, [0.1, 0.3])
    assert len(opened) == 0


def test_it_finds_where_a_region_opened():
    _, _, opened = plot.curve(rows([0.1] * 5, [1, 1.5, 2, 2, 3]), plot.METRIC)
    np.testing.assert_array_equal(opened, [30, 50])


def test_runs_on_flat_ground_have_no_regions():
    flat = [{"steps": 10, plot.METRIC: 0.1}, {"steps": 20, plot.METRIC: 0.2}]
    assert len(plot.curve(flat, plot.METRIC)[2]) == 0


def test_the_moving_average():
    steps = np.array([0.0, 10.0, 20.0, 30.0])
    got = plot.smoothed(steps, np.array([0.0, 3.0, 6.0, 3.0]), 20.0)
    np.testing.assert_allclose(got, [1.5, 3.0, 4.0, 4.5])
    np.testing.assert_array_equal(plot.smoothed(steps, steps, 0.0), steps)


def test_an_unknown_metric_lists_what_there_is():
    with pytest.raises(ValueError, match=r"episode/x: not in .* episode/return_rate"):
        plot.curve(rows([0.1], [1]), "episode/x")


def test_the_command_draws_run_folders(tmp_path, capsys):
    for name, top in (("full", 0.4), ("no_prior", 0.2)):
        (tmp_path / name).mkdir()
        text = "".join(json.dumps(row) + "\n" for row in rows([0.0, top / 2, top], [1, 1, 2]))
        (tmp_path / name / "metrics.jsonl").write_text(text)
    out = tmp_path / "plot.png"
    runs = [str(tmp_path / "full"), str(tmp_path / "no_prior")]
    assert plot.main([*runs, "--out", str(out), "--smooth", "0"]) == 0
    assert out.stat().st_size > 5000
    assert "full: 0.400 after 30 steps" in capsys.readouterr().out


def test_a_folder_without_metrics_is_an_error(tmp_path, capsys):
    assert plot.main([str(tmp_path)]) == 2
    assert "metrics.jsonl: no such file" in capsys.readouterr().err
