"""A character as the retargeting sees it: its links under our names, bones and hull points."""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from getup_jax.motion.clips import Clip
from getup_jax.motion.io.recording import Recording, rest_positions
from getup_jax.motion.retarget.calibrate import anatomical_frames
from getup_jax.motion.retarget.joint_names import map_names, require_links
from getup_jax.physics.character import CharacterSpec


@dataclasses.dataclass(frozen=True, eq=False)
class Body:
    """Look-ups of one character, made once for all clips."""

    character: CharacterSpec
    links: dict[str, int]  # our link name -> link index of the character
    frames: dict[str, np.ndarray]  # our link name -> [3, 3] anatomical frame
    rest: np.ndarray  # [L, 3] m, link positions of the zero pose, relative to the root
    hull: Hull


@dataclasses.dataclass(frozen=True, eq=False)
class Hull:
    """Points whose height minus radius is where the character's geoms touch the floor."""

    link: np.ndarray  # [P] link index
    point: np.ndarray  # [P, 3] m, in the link's frame
    radius: np.ndarray  # [P] m


def body_of(character: CharacterSpec) -> Body:
    """Find the links of a character by name; MotionError where some are missing."""
    skeleton = record(Clip("zero", 30.0, zero_qpos(character)[None]), character)
    links = map_names(skeleton.joint_names, skeleton.parents)
    require_links("character", skeleton.joint_names, links)
    return Body(
        character=character,
        links=links,
        frames=anatomical_frames(skeleton, links),
        rest=rest_positions(skeleton),
        hull=_hull(character.model),
    )


def zero_qpos(character: CharacterSpec) -> np.ndarray:
    """All hinges at zero, root upright: [7 + J]."""
    qpos = np.zeros(7 + character.num_joints)
    qpos[2], qpos[3] = character.neutral_qpos[2], 1.0
    return qpos


def record(clip: Clip, character: CharacterSpec) -> Recording:
    """A clip as a recording: one joint a link, so that it can be written or retargeted."""
    model, data = character.model, mujoco.MjData(character.model)
    parents = model.body_parentid[1:] - 1
    world = np.empty((len(clip.qpos), len(parents), 4))
    for frame, qpos in enumerate(clip.qpos):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        world[frame] = data.xquat[1:]
    turns = Rotation.from_quat(world.reshape(-1, 4), scalar_first=True)
    above = world[:, np.maximum(parents, 0)]
    above[:, parents < 0] = (1.0, 0.0, 0.0, 0.0)
    local = Rotation.from_quat(above.reshape(-1, 4), scalar_first=True).inv() * turns
    translations = np.tile(model.body_pos[1:], (len(world), 1, 1))
    translations[:, 0] = clip.qpos[:, :3]
    return Recording(
        name=clip.name,
        fps=clip.fps,
        joint_names=character.link_names,
        parents=tuple(int(parent) for parent in parents),
        offsets=model.body_pos[1:].copy(),
        translations=translations,
        rotations=local.as_quat(scalar_first=True).reshape(world.shape),
        source=clip.source,
    )


def hull_heights(position: np.ndarray, rotation: np.ndarray, body: Body) -> np.ndarray:
    """Lowest height [F, P] of every hull point, of link poses [F, L, ...]."""
    hull = body.hull
    turned = np.einsum("fpj,pj->fp", rotation[:, hull.link, 2], hull.point)
    return position[:, hull.link, 2] + turned - hull.radius


def _hull(model: mujoco.MjModel) -> Hull:
    link, point, radius = [], [], []
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom])
        if body == 0 or not (model.geom_contype[geom] or model.geom_conaffinity[geom]):
            continue
        corners, round_off = _corners(int(model.geom_type[geom]), model.geom_size[geom])
        turn = Rotation.from_quat(model.geom_quat[geom], scalar_first=True)
        for corner in turn.apply(corners) + model.geom_pos[geom]:
            link.append(body - 1)
            point.append(corner)
            radius.append(round_off)
    return Hull(np.array(link), np.array(point).reshape(-1, 3), np.array(radius))


def _corners(kind: int, size: np.ndarray) -> tuple[np.ndarray, float]:
    """Points [n, 3] in the geom's frame and their common radius."""
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
        return signs * size, 0.0
    if kind in (mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_CYLINDER):
        return np.array([[0, 0, size[1]], [0, 0, -size[1]]]), float(size[0])
    return np.zeros((1, 3)), float(size[0])
