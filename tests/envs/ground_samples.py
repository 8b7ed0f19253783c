"""A small irregular ground with a character on it, and what MuJoCo itself says about starts."""

from __future__ import annotations

import mujoco
import numpy as np

from getup_jax.config import TerrainConfig
from getup_jax.envs.getup.resets.region_pool import Site
from getup_jax.physics.character import CharacterSpec, load_character
from getup_jax.physics.terrain_map import make_terrain

TERRAIN = TerrainConfig(region_size_m=16.0, slope_block_m=8.0, drops=45)


def make_site(physics, config: TerrainConfig = TERRAIN) -> Site:
    ground = make_terrain(config)
    return Site(config, ground, load_character(physics, ground))


def deepest_contact(character: CharacterSpec, qpos: np.ndarray) -> np.ndarray:
    """Distance [N] (m) of the deepest contact with the ground in MuJoCo; inf where there is none.

    Contacts are found up to 2 cm above the ground.
    """
    model = character.model
    floor = model.geom("floor").id
    before = model.geom_margin[floor]
    model.geom_margin[floor] = 0.02
    data, result = mujoco.MjData(model), np.full(len(qpos), np.inf)
    for index, row in enumerate(qpos):
        data.qpos[:] = row
        mujoco.mj_forward(model, data)
        ground = (data.contact.geom == floor).any(axis=1)
        result[index] = data.contact.dist[ground].min(initial=np.inf)
    model.geom_margin[floor] = before
    return result


def lowest_centre(character: CharacterSpec, field, qpos: np.ndarray) -> np.ndarray:
    """Height [N] (m) of the lowest link centre of mass above the ground: negative is inside it."""
    data, result = mujoco.MjData(character.model), np.empty(len(qpos))
    for index, row in enumerate(qpos):
        data.qpos[:] = row
        mujoco.mj_forward(character.model, data)
        centre = data.xipos[1:]
        result[index] = (centre[:, 2] - field.height(centre[:, :2])).min()
    return result
