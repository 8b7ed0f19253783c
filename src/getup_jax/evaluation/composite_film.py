"""Films of composite episodes, with the targets of their goals."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from getup_jax.core.output_file import replacing
from getup_jax.envs.composite.build import BuiltComposite
from getup_jax.envs.composite.goals import Marker
from getup_jax.envs.composite.task import CompositeTask
from getup_jax.evaluation import film as video
from getup_jax.evaluation.composite_rollout import FILMED, CompositeEpisodes
from getup_jax.motion.io import takes as files
from getup_jax.motion.io.takes import Take


def film(
    path: Path,
    built: BuiltComposite,
    episodes: CompositeEpisodes,
    size: tuple[int, int] = video.FILM_SIZE,
) -> None:
    """The first episodes one after the other; markers show what their goals ask for."""
    env = built.environment
    groups = env.config.groups.values()
    names = " + ".join(", ".join(Path(name).stem for name in group.clips) for group in groups)
    scenes = []
    for episode, qpos in enumerate(episodes.qpos[:FILMED]):
        shown = markers(env, episodes, episode)
        scenes.append((qpos, shown, [f"{episode + 1}: {names}"] * len(qpos)))
    write(path, env, scenes, size)


def write_takes(path: Path, env: CompositeTask, episodes: CompositeEpisodes) -> None:
    """The same episodes as animations of a GLB or USD file; goals and balls are not in it."""
    rate = 1.0 / env.engine.control_dt
    takes = [
        Take(f"episode {number}", rate, qpos)
        for number, qpos in enumerate(episodes.qpos[:FILMED], 1)
    ]
    files.write_takes(path, env.character, takes)


def markers(
    env: CompositeTask, episodes: CompositeEpisodes, episode: int
) -> list[list[Marker]] | None:
    """What the goals want to be seen in every step of an episode; None without goals."""
    if episodes.shown is None or not env.goals.names:
        return None
    steps = range(episodes.qpos.shape[1])
    return [env.goals.markers(*episodes.shown.at(episode, step)) for step in steps]


def write(
    path: Path,
    env: CompositeTask,
    scenes: Iterable[tuple[np.ndarray, list[list[Marker]] | None, list[str]]],
    size: tuple[int, int] = video.FILM_SIZE,
) -> None:
    """A film of scenes: poses [F, 7 + J], markers [F], and the line [F] at the top."""
    imageio = video.require()
    with warnings.catch_warnings():
        # starting ffmpeg is a fork and an exec in one, which is safe
        warnings.filterwarnings("ignore", message="os.fork", category=RuntimeWarning)
        rate = round(1.0 / env.engine.control_dt)
        with (
            replacing(path) as part,
            imageio.get_writer(part, fps=rate, macro_block_size=8) as writer,
        ):
            for qpos, shown, lines in scenes:
                images = video.pictures(env.character.model, qpos, size, shown)
                for image, line in zip(images, lines, strict=True):
                    writer.append_data(video.caption(image, line))
