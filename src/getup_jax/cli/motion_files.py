"""Motion files of `getup-motion`, retargeted side by side while it is shown how many are done."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from getup_jax.cli.motion_report import FileReport, report_of
from getup_jax.config import MotionConfig
from getup_jax.core.cpus import cpus
from getup_jax.motion.clips import MotionError
from getup_jax.motion.io.readers import ReadOptions, is_clip, motion_files
from getup_jax.motion.library import MotionLibrary, load_motions, to_retarget
from getup_jax.motion.retarget.cache import Done, Job, Result, read_npz, retarget_files
from getup_jax.motion.retarget.joint_names import read_map
from getup_jax.motion.retarget.retarget import RetargetSettings
from getup_jax.physics.character import CharacterSpec
from getup_jax.runtime.console import duration

_LONG_S = 2.0  # what takes longer than that is shown


def expanded(paths: Sequence[Path]) -> list[Path]:
    """The motion files that arguments stand for; a missing file is reported later."""
    return [file for path in paths for file in _expand(path)]


def _expand(path: Path) -> list[Path]:
    if not path.is_dir():
        return [path]
    files = motion_files(path)
    if not files:
        raise MotionError(f"{path}: no motion files in this folder")
    return files


def read_files(
    args: argparse.Namespace,
    files: Sequence[Path],
    character: CharacterSpec,
    keep: Done | None = None,
) -> list[FileReport]:
    """Retarget every file; `keep` gets each result as soon as it is there.

    Ctrl-C says how many are done: they are in the cache, and the same command goes on there.
    """
    jobs = _jobs(args, files, character)
    with _Progress(len(files)) as progress:

        def done(path: Path, result: Result) -> None:
            if keep is not None:
                keep(path, result)
            progress.advance(path, result)

        try:
            found = retarget_files(list(jobs.values()), cpus(), done)
        except KeyboardInterrupt:
            progress.say(f"{progress.done} of {len(files)} files are done; again goes on there")
            raise
        results = dict(zip(jobs, found, strict=True))
        for file in files:
            if file not in results:
                results[file] = _kept_clip(file, character)
                done(file, results[file])
    return [report_of(file, results[file], character) for file in files]


def load_library(config: MotionConfig, character: CharacterSpec) -> MotionLibrary:
    """As `load_motions`, with what is retargeted to the character shown where that takes long."""
    total = len(to_retarget(config, character))
    with _Progress(total, begin_s=_LONG_S) as progress:
        return load_motions(config, character, lambda path: progress.advance(path))


def _jobs(
    args: argparse.Namespace, files: Sequence[Path], character: CharacterSpec
) -> dict[Path, Job]:
    """What is to be retargeted; clips are not."""
    read = ReadOptions(up=args.up, allow_short=args.allow_short, fps=args.source_fps)
    settings = RetargetSettings(
        fps=args.fps,
        metres=args.scale,
        floor=args.floor,
        names=read_map(args.names) if args.names else None,
    )
    return {file: Job(file, character, read, settings) for file in files if not is_clip(file)}


def _kept_clip(file: Path, character: CharacterSpec) -> Result:
    try:
        return read_npz(file, character)
    except MotionError as error:
        return error


class _Progress:
    """A bar; in a log, which has none, a line a file, from `begin_s` after the start."""

    def __init__(self, total: int, begin_s: float = 0.0) -> None:
        self.done = 0
        self._total, self._begin, self._begin_s = total, time.monotonic(), begin_s
        self._console = Console(stderr=True)
        columns = (TextColumn("retargeting"), BarColumn(), MofNCompleteColumn())
        self._bar = Progress(
            *columns,
            TextColumn("{task.description}"),
            console=self._console,
            transient=begin_s > 0,
            disable=total < 1 or (begin_s > 0 and not self._console.is_terminal),
        )
        self._task = self._bar.add_task("", total=total)

    def __enter__(self) -> _Progress:
        self._bar.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._bar.stop()

    def advance(self, path: Path, result: Result | None = None) -> None:
        """A file is done; from any thread."""
        self.done += 1
        past_s = time.monotonic() - self._begin
        rate = past_s / self.done
        text = f"{rate:.1f} s a file, {duration(rate * (self._total - self.done))} left"
        self._bar.update(self._task, advance=1, description=text)
        if not self._console.is_terminal and self._total > 1 and past_s >= self._begin_s:
            failed = " failed" if isinstance(result, MotionError) else ""
            self.say(f"{self.done}/{self._total} {path.name}{failed}  {text}")

    def say(self, text: str) -> None:
        """A line above the bar."""
        sys.stderr.write(f"{text}\n")  # in one piece, since threads say things
        sys.stderr.flush()
