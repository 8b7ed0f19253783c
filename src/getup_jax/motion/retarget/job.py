"""One file to retarget: what it takes, and what comes of it."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from getup_jax.motion.clips import Clip, MotionError
from getup_jax.motion.io import readers
from getup_jax.motion.io.guard import one_line
from getup_jax.motion.retarget.retarget import RetargetReport, RetargetSettings, retarget
from getup_jax.physics.character import CharacterSpec


@dataclasses.dataclass(frozen=True, eq=False)
class Job:
    """What a worker needs to retarget one file."""

    path: Path
    character: CharacterSpec
    read: readers.ReadOptions
    settings: RetargetSettings


Result = tuple[Clip, RetargetReport] | MotionError


def run_here(job: Job) -> tuple[Clip, RetargetReport]:
    """Read and retarget in this process; MotionError says why it cannot be done."""
    recording = readers.read_motion(job.path, job.read)
    with one_line(job.path.name):
        return retarget(recording, job.character, job.settings)
