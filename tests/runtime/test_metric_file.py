from __future__ import annotations

import io
import json
import math
import sys
import types

import pytest
from rich.console import Console
from rich.table import Table

from getup_jax.config import ConfigError
from getup_jax.runtime.console import Display, as_text, count, describe, duration
from getup_jax.runtime.metric_file import FILE, TIMES, MetricsError, MetricsWriter, read_metrics
from getup_jax.runtime.metric_log import MetricLog, means


def write_lines(folder, *iterations: int, resume: int = 0, **metrics: float) -> None:
    with MetricsWriter(folder, resume) as writer:
        for i in iterations:
            writer.write(i, i * 10, i * 0.5, {"reward": float(i), **metrics})


def test_a_line_is_written_when_write_returns(tmp_path):
    writer = MetricsWriter(tmp_path / "run")
    writer.write(1, 3_000_000_000, 0.12345, {"rollout/reward": 0.5, "loss/value": math.nan})
    line = (tmp_path / "run" / FILE).read_text()
    assert line.count("\n") == 1
    expected = {"iteration": 1, "steps": 3_000_000_000}
    assert json.loads(line) == {**expected, "rollout/reward": 0.5, "loss/value": None}
    time = (tmp_path / "run" / TIMES).read_text()
    assert json.loads(time) == {"iteration": 1, "wall_s": 0.123}
    writer.close()


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_json_has_no_number_for_is_null_and_read_as_nan(tmp_path, value):
    write_lines(tmp_path, 1, bad=value)
    assert '"bad": null' in (tmp_path / FILE).read_text()
    (row,) = read_metrics(tmp_path)
    assert math.isnan(row["bad"])
    assert row["reward"] == 1.0


def test_resuming_drops_the_lines_past_the_checkpoint(tmp_path):
    write_lines(tmp_path, 1, 2, 3, 4)
    with MetricsWriter(tmp_path, 2) as writer:
        assert writer.wall_s == 1.0
    write_lines(tmp_path, 3, resume=2, again=1.0)
    rows = read_metrics(tmp_path / FILE)
    assert [row["iteration"] for row in rows] == [1, 2, 3]
    assert "again" in rows[2]
    assert [row["wall_s"] for row in rows] == [0.5, 1.0, 1.5]
    assert sorted(path.name for path in tmp_path.iterdir()) == [FILE, TIMES]


def test_starting_anew_drops_all_lines(tmp_path):
    write_lines(tmp_path, 1, 2)
    write_lines(tmp_path, 1)
    assert [row["iteration"] for row in read_metrics(tmp_path)] == [1]


def test_a_line_that_a_killed_run_left_unfinished_is_skipped(tmp_path):
    write_lines(tmp_path, 1, 2)
    with (tmp_path / FILE).open("a") as file:
        file.write('{"iteration": 3, "ste')
    assert len(read_metrics(tmp_path)) == 2
    write_lines(tmp_path, 3, resume=3)
    assert [row["iteration"] for row in read_metrics(tmp_path)] == [1, 2, 3]


def test_a_broken_line_elsewhere_is_an_error_that_names_it(tmp_path):
    (tmp_path / FILE).write_text('{"iteration": 1}\nnonsense\n{"iteration": 3}\n')
    with pytest.raises(MetricsError, match=r"metrics.jsonl, line 2: not a JSON object"):
        read_metrics(tmp_path)


@pytest.mark.parametrize(
    ("file", "line", "problem"),
    [
        (FILE, b'{"iteratino": 2}', "iteration: expected a number, got None"),
        (FILE, b'{"iteration": "2"}', "iteration: expected a number, got '2'"),
        (FILE, b"[2]", r"not a JSON object, but \[2\]"),
        (FILE, b'{"iteration": 2, "x": \xff}', "not a JSON object: .*utf-8"),
        (FILE, b"[" * 100_000, "not a JSON object: maximum recursion"),
        (TIMES, b'{"iteration": 2, "wall": 1}', "wall_s: expected a number, got None"),
    ],
)
def test_a_damaged_line_is_one_line_that_says_what_to_do(tmp_path, file, line, problem):
    write_lines(tmp_path, 1, 2)
    lines = (tmp_path / file).read_bytes().splitlines()
    (tmp_path / file).write_bytes(b"\n".join([lines[0], line, lines[1]]))
    for read in (read_metrics, lambda folder: MetricsWriter(folder, 2)):
        with pytest.raises(MetricsError, match=rf"{file}, line 2: {problem}") as caught:
            read(tmp_path)
        assert str(caught.value).endswith("; remove the line or start a new run")
        assert "\n" not in str(caught.value)


def test_a_missing_file_is_an_error(tmp_path):
    with pytest.raises(FileNotFoundError, match="no such file; expected a run folder"):
        read_metrics(tmp_path / "none")


def test_a_metric_cannot_take_a_name_of_the_line_itself(tmp_path):
    with MetricsWriter(tmp_path) as writer, pytest.raises(ValueError, match="steps"):
        writer.write(1, 1, 1.0, {"steps": 2.0})


def test_tensorboard_gets_the_finite_numbers(tmp_path, monkeypatch):
    written, opened = [], {}

    class SummaryWriter:
        def __init__(self, folder, purge_step):
            opened.update(folder=folder, purge_step=purge_step)

        def add_scalar(self, *scalar):
            written.append(scalar)

        def close(self):
            written.append("closed")

    module = types.SimpleNamespace(SummaryWriter=SummaryWriter)
    monkeypatch.setitem(sys.modules, "tensorboardX", module)
    write_lines(tmp_path, 1, 2)
    with MetricsWriter(tmp_path, 1, tensorboard=True) as writer:
        writer.write(2, 20, 1.0, {"a": 0.5, "b": math.nan})
    assert written == [("a", 0.5, 20), "closed"]
    assert opened == {"folder": str(tmp_path / "tensorboard"), "purge_step": 11}


def test_the_library_writes_an_event_file(tmp_path):
    pytest.importorskip("tensorboardX")
    with MetricsWriter(tmp_path, tensorboard=True) as writer:
        writer.write(1, 16, 0.5, {"some_reward": 0.25})
    (file,) = (tmp_path / "tensorboard").glob("events.out.tfevents.*")
    assert b"some_reward" in file.read_bytes()


def test_tensorboards_own_reader_finds_what_the_lines_say(tmp_path):
    """Also of a resumed run: what was written past its checkpoint is hidden."""
    pytest.importorskip("tensorboardX")
    name = "tensorboard.backend.event_processing.event_accumulator"
    reader = pytest.importorskip(name)
    with MetricsWriter(tmp_path, tensorboard=True) as writer:
        for number in (1, 2, 3):
            writer.write(number, 16 * number, 0.5, {"rollout/reward": 0.1 * number})
    (first,) = (tmp_path / "tensorboard").iterdir()
    first.rename(first.with_name(first.name.replace("tfevents.", "tfevents.0")))  # long ago
    with MetricsWriter(tmp_path, 1, tensorboard=True) as writer:
        writer.write(2, 32, 1.0, {"rollout/reward": 0.7, "episode/success": math.nan})
    found = reader.EventAccumulator(str(tmp_path / "tensorboard"))
    found.Reload()
    assert found.Tags()["scalars"] == ["rollout/reward"]
    points = [(event.step, event.value) for event in found.Scalars("rollout/reward")]
    lines = [(row["steps"], row["rollout/reward"]) for row in read_metrics(tmp_path)]
    assert [step for step, _ in points] == [step for step, _ in lines] == [16, 32]
    assert [x for _, x in points] == pytest.approx([x for _, x in lines])


def test_tensorboard_that_is_not_installed_says_how_to_install_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "tensorboardX", None)
    with pytest.raises(ConfigError, match=r"pip install 'getup-jax\[tensorboard\]'"):
        MetricsWriter(tmp_path, tensorboard=True)


# --- means over iterations


def test_means_leave_nan_out():
    rows = [{"a": 1.0, "b": math.nan}, {"a": 3.0, "b": 4.0}, {"a": 5.0, "b": math.nan}]
    assert means(rows) == {"a": 3.0, "b": 4.0}
    assert math.isnan(means(rows[::2])["b"])


def test_a_journal_writes_means_and_speed(tmp_path):
    with MetricsWriter(tmp_path) as writer, Display(100, quiet=True) as display:
        metric_log = MetricLog(writer, display, per_iteration=10, done=4)
        metric_log.flush(4)
        metric_log.add({"rollout/reward": 1.0})
        metric_log.add({"rollout/reward": 3.0})
        metric_log.flush(6)
        metric_log.flush(6)
    (row,) = read_metrics(tmp_path)
    assert (row["iteration"], row["steps"], row["rollout/reward"]) == (6, 60, 2.0)
    assert row["steps_per_s"] > 0
    assert "steps_per_s" not in (tmp_path / FILE).read_text()


@pytest.mark.parametrize(
    ("name", "value", "diverged"),
    [
        ("loss/value", math.nan, True),
        ("ppo/gradient_norm", math.inf, True),
        ("rollout/reward_mine", math.nan, True),
        ("loss/value", 1e30, False),
        ("episode/success", math.nan, False),
    ],
)
def test_a_journal_tells_divergence_from_no_episode(tmp_path, name, value, diverged):
    with MetricsWriter(tmp_path) as writer, Display(1, quiet=True) as display:
        assert MetricLog(writer, display, 1, 0).add({name: value}) == ([name] if diverged else [])


# --- the display


METRICS = {"rollout/reward_total": 0.25, "episode/return_rate": 0.5, "episode/success": math.nan}


def test_the_progress_line():
    expected = "50 k/100 M steps  8 k/s  3 h 28 min left  reward 0.250  return rate 0.500"
    assert describe(50_000, 100_000_000, 8000.0, METRICS) == expected
    assert describe(0, 1000, 0.0, {}) == "0/1 k steps"


@pytest.mark.parametrize(
    ("number", "text"),
    [(0, "0"), (850, "850"), (12_340, "12.3 k"), (4_560_000, "4.56 M"), (2 * 10**9, "2 G")],
)
def test_counts(number, text):
    assert count(number) == text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.4, "0 s"), (59.6, "1 min 00 s"), (200, "3 min 20 s"), (7500, "2 h 05 min")],
)
def test_durations(seconds, text):
    assert duration(seconds) == text


def show(quiet: bool, terminal: bool) -> str:
    file = io.StringIO()
    console = Console(
        file=file, force_terminal=terminal, width=120, soft_wrap=True, highlight=False
    )
    with Display(1000, quiet, console) as display:
        display.log("compiling [bold] ...")
        display.start(0)
        display.update(500, 100.0, METRICS)
        display.close()
        display.log("done")
    return file.getvalue()


def test_plain_lines_where_there_is_no_terminal():
    update = "500/1 k steps  100/s  5 s left  reward 0.250  return rate 0.500"
    assert show(quiet=False, terminal=False).splitlines() == [
        "compiling [bold] ...",
        update,
        "done",
    ]


def test_in_a_notebook_tables_are_text_and_messages_are_lines(monkeypatch, capsys):
    shown: list[object] = []
    monkeypatch.setattr("rich.console._is_jupyter", lambda: True)
    monkeypatch.setattr("rich.jupyter.display", lambda *given: shown.append(given))
    table = Table("style")
    table.add_row("prone")
    assert "prone" in as_text(table, width=40)
    with Display(1) as display:
        display.log("a message")
    assert capsys.readouterr().out == "a message\n"
    assert shown == []


def test_a_bar_on_a_terminal():
    text = show(quiet=False, terminal=True)
    assert "━" in text
    assert "500/1 k steps  100/s  5 s left" in text
    assert text.index("compiling [bold]") < text.index("500/1 k") < text.index("done")
    assert text.rindex("\x1b[?25h") > text.rindex("\x1b[?25l")  # the cursor is shown again


@pytest.mark.parametrize("terminal", [True, False])
def test_quiet_is_silent(terminal):
    assert show(quiet=True, terminal=terminal) == ""
