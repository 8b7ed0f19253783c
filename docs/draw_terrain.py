"""Draw the ground of a config: its heights as a 16-bit image, and a picture with a body on it.

    MUJOCO_GL=egl python docs/draw_terrain.py [configs/terrain.yaml [key=value ...]] [--out docs]

Writes terrain_heights.png (north up; the lowest and the highest place are printed) and
terrain.png. Needs a machine that can render off screen and Pillow (comes with getup-jax[plot]).
"""

from __future__ import annotations

import argparse
from pathlib import Path

import mujoco
import numpy as np
from PIL import Image

from getup_jax.config import ConfigError
from getup_jax.config.load import load_config
from getup_jax.physics.character import load_character
from getup_jax.physics.terrain_map import TerrainMap, make_terrain

WIDTH, HEIGHT = 960, 640  # pixels
AZIMUTH_DEG, ELEVATION_DEG = 115.0, -32.0
COLOURS = 48  # of the palette, which keeps the file small


def main() -> None:
    """Write both files."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("config", nargs="?", default="terrain")
    parser.add_argument("overrides", nargs="*", metavar="key=value")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent, metavar="FOLDER")
    args = parser.parse_args()
    config = load_config(args.config, args.overrides)
    if config.terrain is None:
        raise ConfigError(f"{args.config}: terrain is null, a flat plane; there is nothing to draw")
    ground = make_terrain(config.terrain)
    low, high = save_heights(ground, args.out / "terrain_heights.png")
    print(f"terrain_heights.png: {ground.heights.shape} heights, {low:.3f} to {high:.3f} m")
    model = load_character(config.physics, ground).model
    image = Image.fromarray(picture(model, 2.4 * ground.half))
    image.quantize(COLOURS).save(args.out / "terrain.png", optimize=True)


def save_heights(ground: TerrainMap, file: Path) -> tuple[float, float]:
    """Write the heights as grey levels of 16 bits; returns the heights (m) of black and white."""
    low, high = float(ground.heights.min()), float(ground.heights.max())
    grey = (ground.heights - low) / max(high - low, 1e-9) * (2**16 - 1)
    Image.fromarray(np.round(grey[::-1]).astype(np.uint16)).save(file)
    return low, high


def picture(model: mujoco.MjModel, distance: float) -> np.ndarray:
    """The whole ground [HEIGHT, WIDTH, 3] from above and aside, the character in its middle."""
    model.stat.extent = distance  # how far the camera sees
    data, camera = mujoco.MjData(model), mujoco.MjvCamera()
    camera.azimuth, camera.elevation, camera.distance = AZIMUTH_DEG, ELEVATION_DEG, distance
    data.qpos[:] = model.key("neutral").qpos
    mujoco.mj_forward(model, data)
    with mujoco.Renderer(model, HEIGHT, WIDTH) as renderer:
        renderer.update_scene(data, camera)
        return renderer.render()


if __name__ == "__main__":
    main()
