"""Mirror images of a character's links and hinges, and whether its body has one at all."""

from __future__ import annotations

import mujoco
import numpy as np

from getup_jax.core.mirror import AXIAL, POLAR, SignedPermutation, concatenated, signed
from getup_jax.physics.character import CharacterSpec

_POSES = 4  # compared with their images
_TOLERANCE = 1e-6  # m, kg m^2 and the like
_SIDES = {"_l": "_r", "_r": "_l"}  # ends of the links' names


def joint_mirror(character: CharacterSpec) -> SignedPermutation:
    """Of hinge angles [J] and offsets on them."""
    return SignedPermutation(character.mirror_joint, character.mirror_sign.astype(np.float32))


def link_images(character: CharacterSpec) -> np.ndarray:
    """Index [L] of the link on the other side; a link in the middle is its own."""
    names = character.link_names
    images = [name[:-2] + _SIDES[name[-2:]] if name[-2:] in _SIDES else name for name in names]
    pairs = zip(images, names, strict=True)
    return np.array([names.index(image if image in names else name) for image, name in pairs])


def is_symmetric(character: CharacterSpec) -> bool:
    """Whether the mirror image of every motion is one that the character can do as well.

    Compared are limits and servos of the hinges, and in random poses the links, the geoms and the
    inertia. A body with a racket in one hand is not symmetric.
    """
    if not _same_hinges(character):
        return False
    rng = np.random.default_rng(0)
    hinges = rng.uniform(
        character.joint_lower, character.joint_upper, (_POSES, character.num_joints)
    )
    qpos = np.concatenate([rng.normal(size=(_POSES, 7)), hinges], axis=1)
    qpos[:, 3:7] /= np.linalg.norm(qpos[:, 3:7], axis=1, keepdims=True)
    pairs = zip(qpos, character.mirror(qpos), strict=True)
    return all(_is_image(character, pose, image) for pose, image in pairs)


def _same_hinges(character: CharacterSpec) -> bool:
    """Whether limits, servos, armature and damping are those of the hinges on the other side."""
    model, other = character.model, character.mirror_joint
    if not np.array_equal(other[other], np.arange(len(other))):
        return False
    ends = np.stack([character.joint_lower, character.joint_upper])
    flipped = np.sort(character.mirror_sign * ends[:, other], axis=0)
    hinges = slice(6, 6 + model.nu)
    servo = np.concatenate([model.actuator_gainprm, model.actuator_biasprm], axis=1)
    each = np.column_stack(
        [servo, character.torque_limit, model.dof_armature[hinges], model.dof_damping[hinges]]
    )
    neutral = character.neutral_qpos
    symmetric = np.allclose(character.mirror(neutral), neutral, atol=_TOLERANCE)
    return bool(np.allclose(flipped, ends) and np.allclose(each[other], each) and symmetric)


def _is_image(character: CharacterSpec, pose: np.ndarray, image: np.ndarray) -> bool:
    """Whether links, geoms and inertia in one pose [7 + J] are mirror images of the other's."""
    (links, geoms, inertia), found = (_layout(character, qpos) for qpos in (pose, image))
    turn = concatenated([signed(POLAR), signed(AXIAL), joint_mirror(character)])
    expected = inertia[np.ix_(turn.index, turn.index)] * np.outer(turn.sign, turn.sign)
    if not np.allclose(found[2], expected, atol=_TOLERANCE):
        return False
    flip = np.array([*POLAR])
    if not np.allclose(found[0], links[link_images(character)] * flip, atol=_TOLERANCE):
        return False
    mirrored = geoms.copy()
    mirrored[:, :3] *= flip
    gap = np.abs(mirrored[:, None] - found[1][None]).max(axis=-1)
    return bool((gap.min(axis=1) < _TOLERANCE).all())


def _layout(character: CharacterSpec, qpos: np.ndarray) -> tuple[np.ndarray, ...]:
    """Links [L, 3] (m), geoms [N, 3 + 4] (place, kind and sizes), inertia [6 + J, 6 + J]."""
    model, data = character.model, mujoco.MjData(character.model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    inertia = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, inertia)
    body = model.geom_bodyid > 0
    kinds = np.column_stack([data.geom_xpos, model.geom_type, model.geom_size])[body]
    return data.xpos[1:].copy(), kinds, inertia
