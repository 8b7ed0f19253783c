"""A motion as a film of 1920 x 1080 pixels."""

from __future__ import annotations

import contextlib
import dataclasses
import warnings
from collections.abc import Callable
from pathlib import Path

from getup_jax.editor.simulate import Motion
from getup_jax.editor.takes import Cut, take
from getup_jax.evaluation import film
from getup_jax.motion.retarget.subprocess_job import Stop
from getup_jax.physics.character import CharacterSpec

SIZE = (1080, 1920)  # rows, columns
Progress = Callable[[float], None]  # of the share that is done


def write_film(
    motion: Motion,
    character: CharacterSpec,
    path: Path,
    cut: Cut,
    stop: Stop,
    progress: Progress,
) -> None:
    """Write the part as MP4, a picture at a time; AbandonedError soon after it is stopped."""
    imageio = film.require()
    fps, qpos = take(motion, cut)
    seen = film.View.of(character.model, qpos[0])
    with contextlib.ExitStack() as stack:
        # starting ffmpeg is a fork and an exec in one, which is safe
        stack.enter_context(warnings.catch_warnings())
        warnings.filterwarnings("ignore", message="os.fork", category=RuntimeWarning)
        camera = stack.enter_context(contextlib.closing(film.Camera(character.model, SIZE)))
        writer = stack.enter_context(imageio.get_writer(path, fps=fps, macro_block_size=8))
        for frame, row in enumerate(qpos):
            stop.check()
            writer.append_data(camera.picture(row, _turned(seen, cut, frame / len(qpos))))
            progress((frame + 1) / len(qpos))


def _turned(seen: film.View, cut: Cut, share: float) -> film.View:
    """The view after a share of the film."""
    if not cut.turn:
        return seen
    return dataclasses.replace(seen, azimuth=seen.azimuth + 360.0 * share)
