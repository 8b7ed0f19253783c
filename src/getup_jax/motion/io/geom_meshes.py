"""The shapes of a character as triangles."""

from __future__ import annotations

import dataclasses
from typing import Any

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from getup_jax.physics.character import CharacterSpec

_ROUND = 16  # vertices around a capsule


@dataclasses.dataclass(frozen=True, eq=False)
class Part:
    """Triangles of one shape, in its link's frame."""

    vertices: np.ndarray  # [V, 3] m
    normals: np.ndarray  # [V, 3]
    faces: np.ndarray  # [T, 3] counter-clockwise from outside
    rgba: tuple[float, ...]  # [4]


def link_meshes(character: CharacterSpec) -> list[list[Part]]:
    """The visible shapes of every link [L]; what has no surface of triangles here is left out."""
    model = character.model
    found: list[list[Part]] = [[] for _ in character.link_names]
    for geom in range(model.ngeom):
        link, rgba = int(model.geom_bodyid[geom]) - 1, _colour(model, geom)
        if link < 0 or rgba[3] == 0:
            continue
        shape = _shape(model, geom)
        if shape is None:
            continue
        turn = Rotation.from_quat(model.geom_quat[geom], scalar_first=True)
        vertices = turn.apply(np.array(shape.vertices)) + model.geom_pos[geom]
        normals = turn.apply(np.array(shape.vertex_normals))  # trimesh gives a read-only one
        found[link].append(Part(vertices, normals, np.asarray(shape.faces), rgba))
    return found


def _shape(model: mujoco.MjModel, geom: int) -> Any:
    """The geom as a trimesh in its own frame; None for kinds that characters do not have."""
    import trimesh  # comes with mujoco-mjx; imported here, as it takes a second

    kinds, kind, size = mujoco.mjtGeom, model.geom_type[geom], model.geom_size[geom]
    if kind == kinds.mjGEOM_SPHERE:
        return trimesh.creation.icosphere(subdivisions=2, radius=size[0])
    if kind == kinds.mjGEOM_CAPSULE:
        count = [_ROUND, _ROUND]
        return trimesh.creation.capsule(height=2 * size[1], radius=size[0], count=count)
    if kind == kinds.mjGEOM_CYLINDER:
        return trimesh.creation.cylinder(radius=size[0], height=2 * size[1], sections=_ROUND)
    if kind == kinds.mjGEOM_ELLIPSOID:
        ball = trimesh.creation.icosphere(subdivisions=2, radius=1.0)
        return trimesh.Trimesh(ball.vertices * size, ball.faces)
    if kind == kinds.mjGEOM_BOX:
        box = trimesh.creation.box(extents=2 * size)
        box.unmerge_vertices()  # flat sides
        return box
    if kind == kinds.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        vertex, face = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
        vertices = model.mesh_vert[vertex : vertex + model.mesh_vertnum[mesh]]
        return trimesh.Trimesh(vertices, model.mesh_face[face : face + model.mesh_facenum[mesh]])
    return None


def _colour(model: mujoco.MjModel, geom: int) -> tuple[float, ...]:
    material = model.geom_matid[geom]
    rgba = model.geom_rgba[geom] if material < 0 else model.mat_rgba[material]
    return tuple(round(float(x), 4) for x in rgba)
