"""Gaps between a body and irregular ground, from spheres that fill its geoms; on the host."""

from __future__ import annotations

import mujoco
import numpy as np

from getup_jax.physics.character import CharacterSpec
from getup_jax.physics.terrain import HeightField

TOUCH_M = 0.001  # a body at rest is about this deep in the ground
_ALONG = 5  # spheres along a capsule
_ACROSS = np.array([-1.0, 0.0, 1.0])  # points along a side of a box


def link_gaps(character: CharacterSpec, field: HeightField, qpos: np.ndarray) -> np.ndarray:
    """Smallest gap [N, L] (m) between every link and the ground in poses qpos [N, 7 + J].

    Negative where a link is below the surface. A link without a shape is infinitely far.
    """
    geom, local, radius = _spheres(character.model)
    position, turn = _geom_poses(character.model, qpos)
    centre = position[:, geom] + np.einsum("nsij,sj->nsi", turn[:, geom], local)
    gap = field.clearance(centre, radius)
    link = character.model.geom_bodyid[geom] - 1
    result = np.full((len(qpos), len(character.link_names)), np.inf)
    for index in np.unique(link):
        result[:, index] = gap[:, link == index].min(axis=1)
    return result


def lift(
    character: CharacterSpec, field: HeightField, qpos: np.ndarray, gap_m: float
) -> np.ndarray:
    """Poses [N, 7 + J] moved up or down until their smallest gap to the ground is about gap_m."""
    qpos = qpos.copy()
    for _ in range(2):  # a gap is along the normal, so one move is not the whole way
        qpos[:, 2] += gap_m - link_gaps(character, field, qpos).min(axis=1)
    return qpos


def _geom_poses(model: mujoco.MjModel, qpos: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions [N, G, 3] and rotation matrices [N, G, 3, 3] of all geoms."""
    data = mujoco.MjData(model)
    position, turn = np.empty((len(qpos), model.ngeom, 3)), np.empty((len(qpos), model.ngeom, 9))
    for index, row in enumerate(qpos):
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        position[index], turn[index] = data.geom_xpos, data.geom_xmat
    return position, turn.reshape(len(qpos), model.ngeom, 3, 3)


def _spheres(model: mujoco.MjModel) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Geom [S], centre in it [S, 3] and radius [S] (m) of spheres inside all solid geoms."""
    solid = [g for g in range(model.ngeom) if model.geom_bodyid[g] and model.geom_contype[g]]
    parts = [_geom_spheres(model.geom_type[g], model.geom_size[g]) for g in solid]
    geom = np.repeat(solid, [len(local) for local, _ in parts])
    radius = np.concatenate([np.full(len(local), r) for local, r in parts])
    return geom, np.concatenate([local for local, _ in parts]), radius


def _geom_spheres(kind: int, size: np.ndarray) -> tuple[np.ndarray, float]:
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return np.zeros((1, 3)), size[0]
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        along = np.linspace(-size[1], size[1], _ALONG)
        return along[:, None] * np.array([0.0, 0.0, 1.0]), size[0]
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        points = np.stack(np.meshgrid(_ACROSS, _ACROSS, _ACROSS), axis=-1).reshape(-1, 3)
        return points * size, 0.0
    raise ValueError(f"geom type {kind}: expected spheres, capsules and boxes")
