"""Draw every authored motion as a row of frames: docs/motions/NAME.png, composite/NAME.png.

    MUJOCO_GL=egl python docs/make_contact_sheets.py [NAME ...]

Needs a machine that can render off screen and Pillow (which comes with getup-jax[plot]).
"""

from __future__ import annotations

import sys
from pathlib import Path

import mujoco
import numpy as np
from PIL import Image

from getup_jax.config import PhysicsConfig
from getup_jax.core.resources import asset_path
from getup_jax.motion.authoring.keyframes import clip_from_keyframes, read_keyframes
from getup_jax.motion.clips import Clip
from getup_jax.physics.character import CharacterSpec, load_character

FRAMES, WIDTH, HEIGHT = 8, 150, 200  # pixels of one frame
AZIMUTH_DEG, ELEVATION_DEG, DISTANCE_M, LOOK_AT_M = 118.0, -14.0, 3.4, 0.72
COLOURS = 160  # of the palette, which keeps the files small


def main(names: list[str]) -> None:
    """Draw the named motions, or all of them: the get-ups, and the loops of composite motion."""
    for folder, character in (("", "humanoid49"), ("composite", "humanoid28")):
        _draw(names, folder, load_character(PhysicsConfig(character=character)))


def _draw(names: list[str], folder: str, character: CharacterSpec) -> None:
    files = sorted(asset_path("motions", folder).glob("*.yaml"))
    target_folder = Path(__file__).parent / "motions" / folder
    target_folder.mkdir(parents=True, exist_ok=True)
    with mujoco.Renderer(character.model, HEIGHT, WIDTH) as renderer:
        for path in files:
            if names and path.stem not in names:
                continue
            clip = clip_from_keyframes(read_keyframes(path, character), character)
            target = target_folder / f"{path.stem}.png"
            sheet = Image.fromarray(contact_sheet(clip, character, renderer))
            sheet.quantize(COLOURS, dither=Image.Dither.NONE).save(target, optimize=True)
            print(f"{target.name}: {clip.duration:.1f} s, {target.stat().st_size / 1000:.0f} kB")


def contact_sheet(clip: Clip, character: CharacterSpec, renderer: mujoco.Renderer) -> np.ndarray:
    """Frames at equal steps of time beside each other, [HEIGHT, FRAMES * WIDTH, 3]."""
    data = mujoco.MjData(character.model)
    images = []
    for frame in np.linspace(0, len(clip.qpos) - 1, FRAMES).round().astype(int):
        data.qpos[:] = clip.qpos[frame]
        mujoco.mj_forward(character.model, data)
        renderer.update_scene(data, _camera(data))
        images.append(renderer.render().copy())
    return np.concatenate(images, axis=1)


def _camera(data: mujoco.MjData) -> mujoco.MjvCamera:
    """Looks at the centre of mass from the front left, from always the same height."""
    camera = mujoco.MjvCamera()
    camera.azimuth, camera.elevation, camera.distance = AZIMUTH_DEG, ELEVATION_DEG, DISTANCE_M
    camera.lookat[:] = [*data.subtree_com[1, :2], LOOK_AT_M]
    return camera


if __name__ == "__main__":
    main(sys.argv[1:])
