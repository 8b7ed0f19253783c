"""Lying starts of bodies that were dropped: a passive rag-doll falls and comes to rest [P 5.2]."""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.spatial.transform import Rotation

from getup_jax.envs.getup.resets.lying import (
    Log,
    Place,
    Starts,
    come_to_rest,
    fair_starts,
    spawn,
    until_enough,
)
from getup_jax.envs.getup.resets.terrain_projection import to_normal
from getup_jax.physics.character import CharacterSpec
from getup_jax.physics.surface import lift
from getup_jax.physics.terrain_map import REGIONS

_GAP_M = 0.05  # they are dropped from this height


@dataclasses.dataclass(frozen=True)
class Drop:
    """How bodies are dropped: their posture, and what their servos do while they fall."""

    name: str  # of the cache's files
    prone: float  # share; the others that are not supine fall on a side
    supine: float
    pose_noise_rad: float  # standard deviation of every hinge around the neutral pose
    roll_spread_rad: float = 0.0  # turned about the long axis by up to this much more
    strength: float = 0.0  # torque limits of the servos, which hold the pose; 0: servos off


# limp on the face, on the back and on a side
_LIMP = Drop("falls", prone=0.4, supine=0.4, pose_noise_rad=0.35)
# limp in every orientation, those in between too
_ANY = Drop("any", prone=0.35, supine=0.35, pose_noise_rad=0.35, roll_spread_rad=np.pi / 4)
# [P 5.2] drops prone and supine, [T 2.6] with "small torques"
_PAPER = Drop("paper", prone=0.4, supine=0.6, pose_noise_rad=0.0, strength=0.05)
DROPS: dict[str, tuple[Drop, ...]] = {  # equally many are dropped in each of these ways
    "limp": (_LIMP,),
    "any": (_ANY,),
    "paper": (_PAPER,),
    "varied": (_ANY, _PAPER),
}


def fall(
    character: CharacterSpec,
    place: Place,
    wanted: np.ndarray,
    drop: Drop,
    rng: np.random.Generator,
    log: Log,
) -> Starts:
    """Bodies at rest that were dropped, wanted [R] of them in every region.

    character: with the ground in its model. Falls that slide out of their region, or that do not
    come to rest, are dropped again elsewhere.
    """
    field = place.field()

    def dropped(region: np.ndarray) -> Starts:
        xy = spawn(place, region, rng)
        qpos = _postures(character, drop, field.normal(xy), rng)
        qpos[:, :2] = xy
        qpos = lift(character, field, qpos, _GAP_M)
        qpos = come_to_rest(character, qpos, drop.strength)
        starts = fair_starts(character, place, qpos, region)
        log(f"lying starts: {len(starts.region)} of {len(region)} rag-dolls came to rest")
        return starts

    return until_enough(wanted, dropped, "rag-dolls do not come to rest")


def evenly(count: int, regions: int = len(REGIONS)) -> np.ndarray:
    """Numbers [R] of `count` bodies, about equally many in every irregular region."""
    return np.bincount(1 + np.arange(count) % (regions - 1), minlength=regions)


def _postures(
    character: CharacterSpec, drop: Drop, normal: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Poses [N, 7 + J], prone, supine or on a side along the slope, with any heading."""
    size = len(normal)
    qpos = np.tile(character.neutral_qpos, (size, 1))
    limp = qpos[:, 7:] + drop.pose_noise_rad * rng.standard_normal(qpos[:, 7:].shape)
    qpos[:, 7:] = np.clip(limp, character.joint_lower, character.joint_upper)
    draw = rng.uniform(size=size)
    # turned about the body's long axis: 0 on the face, pi on the back, half on a side
    side = rng.choice([-0.5, 0.5], size=size) * np.pi
    lies_supine = draw < drop.prone + drop.supine
    roll = np.where(draw < drop.prone, 0.0, np.where(lies_supine, np.pi, side))
    vertical = np.array([[0.0, 0.0, 1.0]])
    heading = Rotation.from_rotvec(rng.uniform(-np.pi, np.pi, (size, 1)) * vertical)
    if drop.roll_spread_rad > 0:
        roll = roll + rng.uniform(-drop.roll_spread_rad, drop.roll_spread_rad, size)
    lying = Rotation.from_rotvec([0.0, np.pi / 2, 0.0])
    lying = lying * Rotation.from_rotvec(roll[:, None] * vertical)
    qpos[:, 3:7] = (to_normal(normal) * heading * lying).as_quat(scalar_first=True)
    return qpos
