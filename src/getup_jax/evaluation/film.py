"""Films of evaluated episodes; needs no display, where MUJOCO_GL=egl or osmesa works."""

from __future__ import annotations

import contextlib
import copy
import dataclasses
import time
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from getup_jax.config import ConfigError
from getup_jax.core.output_file import replacing
from getup_jax.envs.composite.goals import Marker
from getup_jax.envs.composite.goals.drawing import add_markers
from getup_jax.evaluation.metrics import episode_values
from getup_jax.evaluation.rollout import Episodes
from getup_jax.motion.io import takes as files
from getup_jax.motion.io.takes import Take
from getup_jax.runtime.console import Display

STYLES = 8  # filmed at most
SIZE = (480, 640)  # rows, columns of a picture
FILM_SIZE = (720, 1280)  # of a film's
_VIEW_DEG = 120.0  # from the body's axis to the direction that the camera looks in
_failures: list[str] = []  # why this process cannot render
_SHADOW = 1024  # pixels; without a GPU, shadows are most of the rendering time
_END_S = 0.5  # the last picture of an episode stays this long


def film(path: Path, result: Episodes, size: tuple[int, int] = FILM_SIZE) -> None:
    """Write a typical episode of up to STYLES styles, one after the other, with a label each."""
    imageio = require()
    env = result.task.environment
    fps = round(1.0 / env.engine.control_dt)
    chosen = typical(result, STYLES)
    with warnings.catch_warnings(), Display(len(chosen), unit="episodes filmed") as display:
        # starting ffmpeg is a fork and an exec in one, which is safe
        warnings.filterwarnings("ignore", message="os.fork", category=RuntimeWarning)
        begin = time.monotonic()
        display.start(0)
        with (
            replacing(path) as part,
            imageio.get_writer(part, fps=fps, macro_block_size=8) as writer,
        ):
            for number, episode in enumerate(chosen, 1):
                frames = result.trace.qpos[result.trace.running[:, episode], episode]
                text = f"{number} of {len(chosen)}: {label(result, episode)}"
                images = render(env.character.model, frames, size)
                for image in images + images[-1:] * round(_END_S * fps):
                    writer.append_data(caption(image, text))
                display.update(number, number / (time.monotonic() - begin), {})


def write_takes(path: Path, result: Episodes) -> None:
    """The same episodes as animations of a GLB or USD file."""
    env = result.task.environment
    takes = [
        Take(
            label(result, episode),
            1.0 / env.engine.control_dt,
            result.trace.qpos[result.trace.running[:, episode], episode],
        )
        for episode in typical(result, STYLES)
    ]
    files.write_takes(path, env.character, takes)


def most_typical(result: Episodes) -> np.ndarray:
    """Poses [F, 7 + J] of a typical episode of the first style."""
    episode = typical(result, 1)[0]
    return result.trace.qpos[result.trace.running[:, episode], episode]


def typical(result: Episodes, most: int) -> list[int]:
    """An episode of each of up to `most` styles, spread over all styles, in their order.

    The one with the median return rate among the successful ones; among all, where none is.
    """
    control_dt = result.task.environment.engine.control_dt
    stand_time_s = result.task.environment.config.stand_time_s
    values = episode_values(result.trace, control_dt, stand_time_s)
    styles = np.unique(result.getup)
    picked = np.unique(np.linspace(0, len(styles) - 1, min(most, len(styles))).round().astype(int))
    return [_median(values, np.flatnonzero(result.getup == styles[i])) for i in picked]


def _median(values: dict[str, np.ndarray], episodes: np.ndarray) -> int:
    good = episodes[values["success"][episodes] == 1.0]
    among = good if len(good) else episodes
    order = among[np.argsort(values["return_rate"][among], kind="stable")]
    return int(order[len(order) // 2])


def label(result: Episodes, episode: int) -> str:
    """The style of an episode, its duration and how it went."""
    style = result.styles[result.getup[episode]]
    went = "stands" if result.trace.success[:, episode].any() else "does not stand"
    return f"{style.name}, {result.trace.duration[0, episode]:.1f} s: {went}"


def caption(image: np.ndarray, text: str) -> np.ndarray:
    """A picture [rows, columns, 3] with a line of text at the top left."""
    from PIL import Image, ImageDraw  # Pillow comes with imageio

    picture = Image.fromarray(image)
    draw = ImageDraw.Draw(picture)
    draw.rectangle((0, 0, picture.width, 26), fill=(0, 0, 0))
    draw.text((8, 4), text, fill=(255, 255, 255), font_size=16)
    return np.asarray(picture)


def render(
    model: mujoco.MjModel,
    qpos: np.ndarray,
    size: tuple[int, int] = SIZE,
    markers: Sequence[Sequence[Marker]] | None = None,
) -> list[np.ndarray]:
    """Pictures [F][rows, columns, 3] of poses qpos [F, 7 + J]; the camera follows the pelvis.

    `markers` [F] are what goal tasks want to be seen. Raises ConfigError where this machine
    cannot render.
    """
    return list(pictures(model, qpos, size, markers))


def pictures(
    model: mujoco.MjModel,
    qpos: np.ndarray,
    size: tuple[int, int] = SIZE,
    markers: Sequence[Sequence[Marker]] | None = None,
) -> Iterator[np.ndarray]:
    """The same, one after the other, for long films."""
    seen = View.of(model, qpos[0])
    with contextlib.closing(Camera(model, size)) as camera:
        for frame, row in enumerate(qpos):
            yield camera.picture(row, seen, markers[frame] if markers else ())


@dataclasses.dataclass(frozen=True)
class View:
    """From where, and above which ground, a motion is seen."""

    azimuth: float  # degrees
    ground: float  # m

    @classmethod
    def of(cls, model: mujoco.MjModel, qpos: np.ndarray) -> View:
        """The view that shows a pose [7 + J] from its side."""
        return cls(view(qpos), ground_below(model, qpos))


class Camera:
    """Takes pictures of poses; the camera follows the pelvis."""

    def __init__(self, model: mujoco.MjModel, size: tuple[int, int] = SIZE) -> None:
        """Raises ConfigError where this machine cannot render."""
        self._model = copy.copy(model)
        self._model.vis.quality.shadowsize = _SHADOW
        frame = self._model.vis.global_  # the largest picture that can be drawn
        frame.offheight = max(frame.offheight, size[0])
        frame.offwidth = max(frame.offwidth, size[1])
        self._data, self._camera = mujoco.MjData(self._model), mujoco.MjvCamera()
        self._camera.distance, self._camera.elevation = 3.4, -14.0
        self._renderer = _renderer(self._model, size)

    def picture(self, qpos: np.ndarray, seen: View, markers: Sequence[Marker] = ()) -> np.ndarray:
        """A picture [rows, columns, 3] of a pose [7 + J]."""
        self._camera.azimuth = seen.azimuth
        self._camera.lookat[:] = (qpos[0], qpos[1], seen.ground + 0.65)
        self._data.qpos[:] = qpos
        mujoco.mj_kinematics(self._model, self._data)
        self._renderer.update_scene(self._data, self._camera)
        add_markers(self._renderer.scene, markers)
        return self._renderer.render()

    def close(self) -> None:
        """Free the renderer."""
        self._renderer.close()


def ground_below(model: mujoco.MjModel, qpos: np.ndarray) -> float:
    """Height (m) of the ground below the pelvis in a pose [7 + J]; 0 on a plane."""
    fields = np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_HFIELD)
    if not len(fields):
        return 0.0
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    above = np.array([qpos[0], qpos[1], qpos[2] + 10.0])
    down = np.array([0.0, 0.0, -1.0])
    return above[2] - mujoco.mj_rayHfield(model, data, int(fields[0]), above, down)


def view(qpos: np.ndarray) -> float:
    """Camera azimuth (degrees) that shows the pose [7 + J] from its side, whatever its heading.

    Across the spine of a lying body; a standing one is seen half from the front.
    """
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, np.asarray(qpos[3:7], np.float64))
    forward, _, up = matrix.reshape(3, 3).T
    axis = up if np.hypot(*up[:2]) > np.sqrt(0.5) else forward
    return float(np.degrees(np.arctan2(axis[1], axis[0]))) + _VIEW_DEG


def _renderer(model: mujoco.MjModel, size: tuple[int, int]) -> mujoco.Renderer:
    """MuJoCo's renderer; after a failure it is not tried again, since GLFW then aborts Python."""
    if not _failures:
        try:
            return mujoco.Renderer(model, *size)
        except Exception as error:
            _failures.append(str(error))
    raise ConfigError(
        f"cannot render pictures ({_failures[0]}); on a machine without a display install Mesa's "
        "EGL (Debian: libegl1 libgl1-mesa-dri) and set MUJOCO_GL=egl before Python starts"
    )


def require(needed_by: str = "--video") -> Any:
    """The module that writes films, or ConfigError that says how to get it."""
    try:
        import imageio.v2 as imageio  # pyright: ignore[reportMissingImports]
        import imageio_ffmpeg  # noqa: F401  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        raise ConfigError(
            f"{needed_by}: needs imageio and its ffmpeg; install the extra: "
            "pip install 'getup-jax[video]'"
        ) from error
    return imageio
