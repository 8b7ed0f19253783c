"""Films of evaluated episodes; needs no display, where MUJOCO_GL=egl or osmesa works."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from getup_jax.config import ConfigError
from getup_jax.motion.clips import GetUp

EPISODES = 6
SIZE = (480, 640)  # rows, columns


def film(
    path: Path, model: mujoco.MjModel, trace: Any, getup: np.ndarray, getups: Sequence[GetUp]
) -> None:
    """Write the first episodes of as many styles as possible, one after the other."""
    writer_module = _imageio()
    _, first = np.unique(getup, return_index=True)
    chosen = np.sort(first)[:EPISODES]
    with writer_module.get_writer(path, fps=30, macro_block_size=8) as writer:
        for episode in chosen:
            frames = trace.qpos[trace.running[:, episode], episode]
            for image in render(model, frames):
                writer.append_data(image)


def render(
    model: mujoco.MjModel, qpos: np.ndarray, size: tuple[int, int] = SIZE, azimuth: float = 120.0
) -> list[np.ndarray]:
    """Pictures [F][rows, columns, 3] of poses qpos [F, 7 + J]; the camera follows the pelvis."""
    data, camera = mujoco.MjData(model), mujoco.MjvCamera()
    camera.distance, camera.elevation, camera.azimuth = 3.4, -14.0, azimuth
    images = []
    with _renderer(model, size) as renderer:
        for row in qpos:
            data.qpos[:] = row
            mujoco.mj_kinematics(model, data)
            camera.lookat[:] = (row[0], row[1], 0.65)
            renderer.update_scene(data, camera)
            images.append(renderer.render())
    return images


def _renderer(model: mujoco.MjModel, size: tuple[int, int]) -> mujoco.Renderer:
    if "MUJOCO_GL" not in os.environ and "DISPLAY" not in os.environ and sys.platform == "linux":
        os.environ["MUJOCO_GL"] = "egl"
    try:
        return mujoco.Renderer(model, *size)
    except Exception as error:
        raise ConfigError(
            f"--video: cannot render ({error}); on a machine without a display install Mesa's EGL "
            "(Debian: libegl1 libgl1-mesa-dri) and set MUJOCO_GL=egl"
        ) from error


def _imageio() -> Any:
    try:
        import imageio.v2 as imageio  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        raise ConfigError(
            "--video: needs imageio; install the extra: pip install 'getup-jax[video]'"
        ) from error
    return imageio
