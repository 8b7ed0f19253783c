"""What a long command tells its user: a live bar on a terminal, plain lines elsewhere."""

from __future__ import annotations

import contextlib
import errno
import io
import math
import os
import sys
from collections.abc import Mapping
from typing import IO, Any

from rich.console import Console, RenderableType
from rich.progress import BarColumn, Progress, TextColumn
from rich.table import Column

# The figures shown: the last part of a metric's name (`rollout/reward_total`), and its label.
KEY_METRICS = {"reward_total": "reward", "return_rate": "return rate", "success": "success"}
_GONE = (errno.EIO, errno.EPIPE)  # of a terminal that was closed, of a pipe


class Display:
    """Messages and the progress of a run of `total` steps (or other units); quiet shows neither.

    Use as a context manager; `start` begins the bar, so that messages come before it.
    """

    def __init__(
        self,
        total: int,
        quiet: bool = False,
        console: Console | None = None,
        unit: str = "steps",
    ) -> None:
        self._total, self._unit = total, unit
        self._quiet = quiet
        output: Any = _Output(sys.stdout)
        # a notebook gets plain lines: rich would show each as a picture of its own
        self._console = console or Console(
            file=output, highlight=False, soft_wrap=True, force_jupyter=False
        )
        self._bar: Progress | None = None

    def log(self, message: str) -> None:
        """One message, above the bar where there is one."""
        if not self._quiet:
            self._console.print(message, markup=False)

    def start(self, steps: int) -> None:
        """Begin the bar at `steps` steps done; no bar where the output is not a terminal."""
        if self._quiet or not self._console.is_terminal:
            return
        column = Column(no_wrap=True, overflow="ellipsis")
        text = TextColumn("{task.description}", markup=False, table_column=column)
        self._bar = Progress(BarColumn(bar_width=20), text, console=self._console)
        self._bar.add_task(
            describe(steps, self._total, math.nan, {}, self._unit), total=self._total
        )
        self._bar.start()

    def update(self, steps: int, steps_per_s: float, metrics: Mapping[str, float]) -> None:
        """Show how far the run is."""
        text = describe(steps, self._total, steps_per_s, metrics, self._unit)
        if self._bar is None:
            self.log(text)
        else:
            self._bar.update(self._bar.task_ids[0], completed=steps, description=text)

    def __enter__(self) -> Display:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the bar; messages can still be logged."""
        if self._bar is not None:
            self._bar.stop()
            self._bar = None


class _Output:
    """Standard output that no longer matters where its terminal or reader is gone.

    A training whose window was closed has still to be saved.
    """

    def __init__(self, stream: IO[str]) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """As the stream's."""
        self._do("write", text)
        return len(text)

    def flush(self) -> None:
        """As the stream's."""
        self._do("flush")

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def _do(self, name: str, *arguments: str) -> None:
        try:
            getattr(self._stream, name)(*arguments)
        except OSError as error:
            if error.errno not in _GONE:
                return  # a full disk may have space for the next line
            # to nowhere from here on, also what Python still has to flush when it ends
            with contextlib.suppress(OSError), open(os.devnull, "w") as nowhere:
                os.dup2(nowhere.fileno(), self._stream.fileno())


def as_text(*views: RenderableType, width: int) -> str:
    """Tables of rich as text, also in a notebook, where a console shows them instead."""
    out = io.StringIO()
    console = Console(file=out, width=width, force_jupyter=False)
    for view in views:
        console.print(view)
    return out.getvalue()


def describe(
    steps: int, total: int, steps_per_s: float, metrics: Mapping[str, float], unit: str = "steps"
) -> str:
    """One line: steps (or other units) done, speed, time left and the key metrics."""
    parts = [f"{count(steps)}/{count(total)} {unit}"]
    if steps_per_s > 0:
        left = max(total - steps, 0) / steps_per_s
        rate = count(round(steps_per_s)) if steps_per_s >= 10 else f"{steps_per_s:.1f}"
        parts += [f"{rate}/s", f"{duration(left)} left"]
    for name, label in KEY_METRICS.items():
        value = find(metrics, name)
        if value is not None and math.isfinite(value):
            parts.append(f"{label} {value:.3f}")
    return "  ".join(parts)


def find(metrics: Mapping[str, float], name: str) -> float | None:
    """The first metric of that name, with or without a group before it."""
    return next((v for key, v in metrics.items() if key.rpartition("/")[2] == name), None)


def count(number: int) -> str:
    """A count in three figures: 850, 12.3 k, 4.56 M."""
    for size, suffix in ((10**9, " G"), (10**6, " M"), (10**3, " k")):
        if number >= size:
            return f"{number / size:.3g}{suffix}"
    return str(number)


def duration(seconds: float) -> str:
    """A time span as 2 h 05 min, 3 min 20 s or 40 s."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes:02d} min"
    return f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"
