"""metrics.jsonl: one JSON object a line, the one consistent history of a run.

Every line has `iteration` and `steps` beside the metrics; NaN is null. What a clock says, `wall_s`
and `steps_per_s`, goes into times.jsonl, so that the same seed on the same machine gives the same
metrics.jsonl, bit for bit. TensorBoard and Weights & Biases get the same numbers where they are
asked for.
"""

from __future__ import annotations

import importlib
import json
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TextIO

from getup_jax.config import ConfigError
from getup_jax.config.check import shown
from getup_jax.runtime.wandb_log import WandbLog

FILE = "metrics.jsonl"
TIMES = "times.jsonl"
_OWN = ("iteration", "steps", "wall_s")
_CLOCK = "steps_per_s"  # a metric that belongs to the times


class MetricsError(ValueError):
    """A line of the history is damaged; the text names the file and the line."""


class MetricsWriter:
    """Appends lines to FOLDER/metrics.jsonl and times.jsonl, each flushed when it is written.

    Lines past `resume_iteration` are dropped first, and all of them where that is 0, so that
    a resumed run writes each iteration once.
    """

    def __init__(
        self,
        folder: Path,
        resume_iteration: int = 0,
        tensorboard: bool = False,
        wandb: WandbLog | None = None,
    ) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        kept = _keep(folder / FILE, resume_iteration)
        times = _keep(folder / TIMES, resume_iteration)
        self.wall_s: float = times[-1]["wall_s"] if times else 0.0  # s, of the last line
        self._board, self._wandb = None, wandb
        if tensorboard:
            # What an earlier run wrote past the last kept line is hidden.
            purge = kept[-1]["steps"] + 1 if kept else 0
            writer = tensorboard_module().SummaryWriter
            self._board = writer(str(folder / "tensorboard"), purge_step=purge)
        self._file = (folder / FILE).open("a", encoding="utf-8")
        self._times = (folder / TIMES).open("a", encoding="utf-8")

    def write(
        self, iteration: int, steps: int, wall_s: float, metrics: Mapping[str, float]
    ) -> None:
        """Add one line to either file; `wall_s` counts from the start of the whole run."""
        taken = [name for name in _OWN if name in metrics]
        if taken:
            raise ValueError(f"metrics: the names {taken} are the line's own; rename them")
        values = {name: _finite(value) for name, value in metrics.items()}
        time = {"iteration": iteration, "wall_s": round(wall_s, 3)}
        time |= {name: values[name] for name in values if name == _CLOCK}
        row = {"iteration": iteration, "steps": steps}
        row |= {name: values[name] for name in values if name != _CLOCK}
        _append(self._times, time)
        _append(self._file, row)
        self.wall_s = time["wall_s"]
        if self._board is not None:
            for name, value in values.items():
                if value is not None:
                    self._board.add_scalar(name, value, steps)
        if self._wandb is not None:
            self._wandb.write(steps, values)

    def close(self) -> None:
        """Close the files."""
        self._file.close()
        self._times.close()
        if self._board is not None:
            self._board.close()
        if self._wandb is not None:
            self._wandb.close()

    def __enter__(self) -> MetricsWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class NoMetrics:
    """In the place of a `MetricsWriter`, where another process writes the history."""

    wall_s = 0.0

    def write(
        self, iteration: int, steps: int, wall_s: float, metrics: Mapping[str, float]
    ) -> None:
        """Write nothing."""


def read_metrics(path: str | Path) -> list[dict[str, Any]]:
    """The lines of a run folder's metrics.jsonl (or of that file) with their times, nulls as NaN.

    Raises FileNotFoundError; a last line that a killed run left unfinished is skipped.
    """
    path = Path(path) / FILE if Path(path).is_dir() else Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"{path}: no such file; expected a run folder or its {FILE}")
    times = {row["iteration"]: row for row in _rows(path.with_name(TIMES))}
    rows = [row | times.get(row["iteration"], {}) for row in _rows(path)]
    return [{k: math.nan if v is None else v for k, v in row.items()} for row in rows]


def _append(file: TextIO, row: Mapping[str, Any]) -> None:
    file.write(json.dumps(row, allow_nan=False) + "\n")
    file.flush()


def _keep(path: Path, last: int) -> list[dict[str, Any]]:
    """Drop the file's lines past an iteration; returns the others."""
    kept = [row for row in _rows(path) if row["iteration"] <= last]
    _rewrite(path, kept)
    return kept


def _rows(path: Path) -> list[dict[str, Any]]:
    """The parsed lines; none where there is no file.

    A last line that is not JSON was left unfinished.
    """
    lines = path.read_bytes().splitlines() if path.exists() else []
    needed = ("iteration", "wall_s") if path.name == TIMES else ("iteration",)
    rows = []
    for number, line in enumerate(lines, start=1):
        try:
            rows.append(json.loads(line))
        except (ValueError, RecursionError) as error:
            if number == len(lines):
                break
            problem = f"not a JSON object: {' '.join(str(error).split())}"
        else:
            problem = _problem(rows[-1], needed)
        if problem is not None:
            hint = "remove the line or start a new run"
            raise MetricsError(f"{path}, line {number}: {problem}; {hint}")
    return rows


def _problem(row: Any, needed: Sequence[str]) -> str | None:
    """What is wrong with a parsed line, or None."""
    if not isinstance(row, dict):
        return f"not a JSON object, but {shown(row)}"
    for name in needed:
        if isinstance(row.get(name), bool) or not isinstance(row.get(name), int | float):
            return f"{name}: expected a number, got {shown(row.get(name))}"
    return None


def _rewrite(path: Path, rows: list[dict[str, Any]]) -> None:
    """Replace the file's lines in one step: a reader sees all old or all new ones."""
    fresh = path.with_suffix(".new")
    fresh.write_text("".join(json.dumps(row) + "\n" for row in rows), encoding="utf-8")
    os.replace(fresh, path)


def _finite(value: float) -> float | None:
    value = float(value)
    return value if math.isfinite(value) else None


def tensorboard_module() -> Any:
    """The module tensorboardX, or ConfigError with an install hint."""
    try:
        return importlib.import_module("tensorboardX")
    except ImportError:
        hint = "pip install 'getup-jax[tensorboard]'"
        raise ConfigError(f"train.tensorboard: needs tensorboardX; install it: {hint}") from None
