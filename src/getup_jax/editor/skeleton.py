"""Motions on the character's skeleton as other software expects it: at rest it stands as a T."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from getup_jax.editor.simulate import link_poses
from getup_jax.motion.io.recording import Recording, turned
from getup_jax.physics.character import CharacterSpec

# The character faces +X; with this turn it faces -Y here, which is +Z in files with Y up.
_TO_FRONT = Rotation.from_euler("z", -90.0, degrees=True)
_SIDES = (("hand_l", (0.0, 1.0, 0.0)), ("hand_r", (0.0, -1.0, 0.0)))


def recording(name: str, fps: float, qpos: np.ndarray, character: CharacterSpec) -> Recording:
    """Poses [F, 7 + J] as a recording: a joint a link, Z up, metres; the rest pose is a T
    that faces -Y.

    A joint's rotation B is that of its link R less that of the rest pose W: B = R W^T. Its place in
    the parent's frame is the link's own, turned by the parent's W, so that every link is where it
    was.
    """
    model, rest = character.model, t_pose(character)
    parents = model.body_parentid[1:] - 1
    links = link_poses(character, qpos).astype(np.float64)
    frames, count = links.shape[:2]
    world = Rotation.from_quat(links[..., 3:].reshape(-1, 4), scalar_first=True).as_matrix()
    world = world.reshape(frames, count, 3, 3) @ rest.transpose(0, 2, 1)
    local, offsets, ends = world.copy(), model.body_pos[1:].copy(), _ends(character)
    offsets[0] = 0.0
    for link, parent in enumerate(parents):
        if parent >= 0:
            local[:, link] = world[:, parent].transpose(0, 2, 1) @ world[:, link]
            offsets[link] = rest[parent] @ offsets[link]
    translations = np.tile(offsets, (frames, 1, 1))
    translations[:, 0] = links[:, 0, :3]
    rotations = Rotation.from_matrix(local.reshape(-1, 3, 3)).as_quat(scalar_first=True)
    made = Recording(
        name=name,
        fps=fps,
        joint_names=character.link_names,
        parents=tuple(int(parent) for parent in parents),
        offsets=offsets,
        translations=translations,
        rotations=rotations.reshape(frames, count, 4),
        ends={link: rest[link] @ end for link, end in ends.items()},
        source="getup-edit",
    )
    return turned(made, _TO_FRONT)


def t_pose(character: CharacterSpec) -> np.ndarray:
    """Rotations [L, 3, 3] of the links as the character stands with its arms to the sides.

    The character's own zero pose, facing +X, with the arms turned there; one without hands stays.
    """
    model, names = character.model, character.link_names
    rest = np.tile(np.eye(3), (len(names), 1, 1))
    for hand, side in _SIDES:
        if hand not in names:
            continue
        arm = _arm(names.index(hand), model.body_parentid[1:] - 1)
        turn = np.eye(3)
        for link, child in zip(arm, [*arm[1:], None], strict=True):
            if child is not None:
                along = model.body_pos[1 + child] / np.linalg.norm(model.body_pos[1 + child])
                turn = Rotation.align_vectors([side], [along])[0].as_matrix()
            rest[link] = turn
    return rest


def _arm(hand: int, parents: np.ndarray) -> list[int]:
    """The links from the upper arm to the hand: those from which no other limb branches off."""
    arm = [hand]
    while parents[arm[0]] >= 0 and (parents == parents[arm[0]]).sum() == 1:
        arm.insert(0, int(parents[arm[0]]))
    return arm


def _ends(character: CharacterSpec) -> dict[int, np.ndarray]:
    """The tip of every last link: as far past the middle of its first shape as the joint is."""
    model = character.model
    inner = set(model.body_parentid[1:].tolist())
    return {
        body - 1: 2.0 * model.geom_pos[model.body_geomadr[body]]
        for body in range(1, model.nbody)
        if body not in inner
    }
