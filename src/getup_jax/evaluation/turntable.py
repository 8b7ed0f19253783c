"""Stills of one episode from all around, on one sheet: rows are moments, columns are directions."""

from __future__ import annotations

import contextlib
import dataclasses
from pathlib import Path

import mujoco
import numpy as np

from getup_jax.core.output_file import replacing
from getup_jax.evaluation import film
from getup_jax.evaluation.film import Camera, View

MOMENTS, DIRECTIONS = 4, 6
SIZE = (360, 320)  # rows, columns of a still


def write_turntable(path: Path, model: mujoco.MjModel, qpos: np.ndarray) -> None:
    """The sheet of a motion qpos [F, 7 + J] as a picture file.

    Raises ConfigError where this machine cannot render, or the extra `video` is missing.
    """
    imageio = film.require("--turntable")
    picture = sheet(model, qpos)
    with replacing(path) as part:
        imageio.imwrite(part, picture)


def sheet(model: mujoco.MjModel, qpos: np.ndarray) -> np.ndarray:
    """Stills [MOMENTS * rows, DIRECTIONS * columns, 3] at even times, first and last included."""
    frames = np.linspace(0, len(qpos) - 1, MOMENTS).round().astype(int)
    seen = View.of(model, qpos[0])
    around = 360.0 / DIRECTIONS * np.arange(DIRECTIONS)
    with contextlib.closing(Camera(model, SIZE)) as camera:
        rows = [
            [
                camera.picture(qpos[frame], dataclasses.replace(seen, azimuth=seen.azimuth + turn))
                for turn in around
            ]
            for frame in frames
        ]
        return np.concatenate([np.concatenate(row, axis=1) for row in rows])
