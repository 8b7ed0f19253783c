"""The mirror image of the get-up task: what of its observation and its action is left and right."""

from __future__ import annotations

import numpy as np

from getup_jax.core import mirror
from getup_jax.core.mirror import AXIAL, POLAR, QUATERNION, SignedPermutation, Symmetry
from getup_jax.envs.getup.observation import GRID_POINTS, Observer
from getup_jax.physics.character import CharacterSpec
from getup_jax.physics.mirror_image import is_symmetric, joint_mirror, link_images
from getup_jax.pose_prior.prior import PosePrior


def find_symmetry(
    character: CharacterSpec, observer: Observer, prior: PosePrior | None
) -> Symmetry | None:
    """The symmetry of the get-up task; None where it has none.

    It has none with a pose prior that is not mirrored, as the images of its latents mean nothing,
    and with a body that is not symmetric.
    """
    if (prior is not None and not prior.mirrored) or not is_symmetric(character):
        return None
    action = action_mirror(character, 0 if prior is None else prior.latent_size)
    return Symmetry(observation_mirror(observer, character, action), action)


def action_mirror(character: CharacterSpec, latent_size: int) -> SignedPermutation:
    """Of actions [A]: the latent pose [Z], then an offset for every hinge [J]."""
    return mirror.concatenated([mirror.latent(latent_size), joint_mirror(character)])


def observation_mirror(
    observer: Observer, character: CharacterSpec, action: SignedPermutation
) -> SignedPermutation:
    """Of raw observations [O], in the order and with the sizes of the observer's table.

    Raises ValueError where the image of a block is not known or has another size.
    """
    links = link_images(character)[1:] - 1
    rows = np.arange(GRID_POINTS)
    images = {
        "joint_rotation": mirror.vectors(links, mirror.signed(QUATERNION)),
        "link_position": mirror.vectors(links, mirror.signed(POLAR)),
        "link_angular_velocity": mirror.vectors(links, mirror.signed(AXIAL)),
        "link_linear_velocity": mirror.vectors(links, mirror.signed(POLAR)),
        "features": mirror.CURVE,
        "height_map": mirror.vectors(rows, _reversed(GRID_POINTS)),
        "action": action,
    }
    parts = []
    for name, size in observer.table:
        image = images.get(name)
        if name == "targets":  # as many as the settings say
            image = mirror.vectors(np.arange(size // mirror.CURVE.size), mirror.CURVE)
        if image is None or image.size != size:
            raise ValueError(
                f"observation block {name}: expected its mirror image, of {size} numbers, in "
                f"envs/getup/symmetry.py, got {image and image.size}; network.mirror=false needs "
                "none"
            )
        parts.append(image)
    return mirror.concatenated(parts)


def _reversed(size: int) -> SignedPermutation:
    """From right to left."""
    return SignedPermutation(np.arange(size)[::-1], np.ones(size, np.float32))
