"""Irregular ground in a MuJoCo model: a height field in place of the floor."""

from __future__ import annotations

import mujoco
import numpy as np

from getup_jax.config import ConfigError
from getup_jax.physics.terrain_map import TerrainMap

FLOOR = "floor"  # the ground's geom, plane or height field
_BASE_M = 1.0  # how far the solid ground reaches below its lowest point
_VIEW_M = 3.0  # what cameras see reaches from a hundredth to fifty times as far
_STUD_M = 0.01  # radius of the studs under the soles
GROUND_ONLY = 2  # collision bit that only the ground answers to


def replace_floor(spec: mujoco.MjSpec, ground: TerrainMap) -> None:
    """Put the height field of `ground` where the floor was, with the floor's surface."""
    plane = spec.geom(FLOOR)
    if plane is None or plane.type != mujoco.mjtGeom.mjGEOM_PLANE:
        raise ConfigError(f"physics.character: terrain needs a plane named {FLOOR!r} to replace")
    low, high = ground.heights.min(), ground.heights.max()
    range_m = max(high - low, 1e-3)
    rows, columns = ground.heights.shape
    field = spec.add_hfield(name="terrain", nrow=rows, ncol=columns)
    field.size[:] = ground.half, ground.half, range_m, _BASE_M
    field.userdata = ((ground.heights - low) / range_m).ravel().tolist()
    spec.worldbody.add_geom(
        name="terrain",
        type=mujoco.mjtGeom.mjGEOM_HFIELD,
        hfieldname="terrain",
        pos=[0.0, 0.0, low],
        friction=plane.friction,
        condim=plane.condim,
        material=plane.material,
        conaffinity=plane.conaffinity | GROUND_ONLY,
    )
    spec.delete(plane)
    spec.geom("terrain").name = FLOOR
    spec.stat.extent = _VIEW_M  # by default the field's size, which puts near bodies out of sight
    for light in spec.lights:
        light.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL  # the file's lamps light its origin
    _add_studs(spec)


def _add_studs(spec: mujoco.MjSpec) -> None:
    """Small spheres in the lower corners of every box, which meet the ground and nothing else.

    MuJoCo gives a box one contact with each triangle of a height field, and on one contact a sole
    tips over. Four more at its corners hold it as a plane would. They have no mass.
    """
    for body in spec.bodies:
        for box in [g for g in body.geoms if g.type == mujoco.mjtGeom.mjGEOM_BOX]:
            corner = np.asarray(box.size) - _STUD_M
            for x in (-1, 1):
                for y in (-1, 1):
                    body.add_geom(
                        type=mujoco.mjtGeom.mjGEOM_SPHERE,
                        size=[_STUD_M, 0.0, 0.0],
                        pos=box.pos + corner * [x, y, -1],
                        mass=0.0,
                        contype=GROUND_ONLY,
                        conaffinity=0,
                        condim=box.condim,
                        friction=box.friction,
                        material=box.material,
                    )
