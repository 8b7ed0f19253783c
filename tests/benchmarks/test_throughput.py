"""The benchmarks as people run them; the slow ones in the smallest sizes, with all their parts."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import throughput
from support.command import command

ROOT = Path(__file__).parent.parent.parent
PARTS = ["raw", "rollout", "update", "iteration", "training"]


def test_rates_are_of_all_simulations_and_ratios_of_the_same_round():
    seconds, raw = [2.0, 4.0, 8.0], [1.0, 1.0, 4.0]
    assert throughput.rates(seconds, raw, steps=16) == {
        "median": 4.0,
        "slowest": 2.0,
        "fastest": 8.0,
        "of_raw": 0.5,
    }


def test_rounds_are_interleaved_and_go_on_for_the_budget(monkeypatch):
    clock, order = iter(range(1000)), []
    monkeypatch.setattr(throughput.time, "perf_counter", lambda: next(clock))
    parts = {name: lambda name=name: order.append(name) for name in ("raw", "rollout")}
    seconds = throughput.measure(parts, 20.0)
    assert order == ["raw", "rollout"] * len(seconds["raw"])
    assert len(seconds["raw"]) == 5  # five ticks a round
    assert seconds["rollout"] == [1] * 5
    assert len(throughput.measure(parts, 0.0)["raw"]) == throughput.MIN_ROUNDS


def test_training_goes_on_where_it_was_and_counts_what_ended():
    training = throughput.Training(
        lambda world, state: (state + world, {"episode/count": state}), 1, 10
    )
    training.warm_up(1.0, 0.25)
    assert training.ended == []
    training.run()
    training.run()
    assert training.ended == [14.0, 15.0]


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--config", "nowhere"], "ConfigError: nowhere: no such config file"),
        (["ppo.num_envs=-1"], "ConfigError: ppo.num_envs"),
    ],
)
def test_what_is_wrong_is_one_line(monkeypatch, capsys, words, text):
    monkeypatch.setattr("sys.argv", ["throughput.py", *words])
    with pytest.raises(SystemExit) as caught:
        command(throughput.main)
    assert caught.value.code == 2
    error = capsys.readouterr().err
    assert error.startswith(text)
    assert error.count("\n") == 1


def run(words: list[str], folder: Path) -> str:
    """The output of a command that must succeed; its cache is its own."""
    environment = {**os.environ, "GETUP_JAX_CACHE": str(folder), "PYTHONPATH": str(ROOT / "src")}
    done = subprocess.run(words, cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("name", ["terrain", "composite_juggling"])
def test_throughput_shows_every_part(tmp_path, name):
    file = tmp_path / "rates.json"
    script = [sys.executable, "benchmarks/throughput.py", "--quick", "--config", name]
    shown = run([*script, "--json", str(file)], tmp_path)
    assert "training as it runs" in shown
    result = json.loads(file.read_text())
    assert list(result["parts"]) == PARTS
    assert result["parts"]["raw"]["of_raw"] == 1.0
    for row in result["parts"].values():
        assert 0 < row["slowest"] <= row["median"] <= row["fastest"]
    assert result["episodes_ended_per_1000_steps"] > 0


@pytest.mark.slow
def test_make_bench_runs_every_benchmark(tmp_path):
    if shutil.which("make") is None:
        pytest.skip("needs make")
    # this environment as it is: nothing is set up
    own = [f"VENV={sys.prefix}", "-o", f"{sys.prefix}/.installed"]
    shown = run(["make", "bench", "ARGS=--quick", *own], tmp_path)
    for file in (ROOT / "benchmarks").glob("*.py"):
        assert f"== benchmarks/{file.name}" in shown
    assert "training as it runs" in shown
