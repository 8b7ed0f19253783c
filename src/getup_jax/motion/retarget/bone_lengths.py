"""The lengths of a recording's bones: their unit, and what to do where a file gives them none."""

from __future__ import annotations

import itertools
from collections.abc import Mapping

import numpy as np

from getup_jax.motion.clips import MotionError
from getup_jax.motion.io.recording import Recording, rest_positions
from getup_jax.motion.retarget.joint_names import listed

# Units that motion files come in: m, cm, inch, mm, and CMU's (inches times 0.45).
_UNITS_M = (1.0, 0.01, 0.0254, 0.001, 0.0254 / 0.45)
_LEG_M = 0.83  # thigh and shin of an adult
_NOTHING = 1e-3  # a bone of this share of the skeleton's size has no length
_LEG = ("thigh", "shin", "foot")
_LIMBS = (_LEG, ("arm", "forearm", "hand"))


def require_body(recording: Recording, links: Mapping[str, int]) -> Recording:
    """The recording, with a warning of limbs' bones that have no length.

    Raises MotionError where hips, a leg or the trunk have none: then nothing says where the body's
    left is, how large it is or how it bends.
    """
    rest = rest_positions(recording)
    name = {link: recording.joint_names[joint] for link, joint in links.items()}

    def apart(first: str, second: str) -> bool:
        return bone_length(rest, links, first, second) > 0

    both = ("thigh_l", "thigh_r")
    if not apart(*both):
        legs = [f"{part}_{side}" for side in "lr" for part in _LEG]
        every = not any(apart("thigh_l", link) for link in legs)
        flat = "; all bones of the legs are without length" if every else ""
        raise _no_length(recording, " and ".join(name[link] for link in both), flat)
    for side in "lr":
        hip, knee, ankle = (f"{part}_{side}" for part in _LEG)
        if not apart(hip, knee) and not apart(knee, ankle):
            raise _no_length(recording, f"{name[hip]}, {name[knee]} and {name[ankle]}")
    trunk = [link for link in ("spine_low", "spine_mid", "spine_upper", "neck") if link in links]
    if trunk and not any(apart(upper, hip) for upper in trunk for hip in both):
        raise _no_length(recording, f"{name['pelvis']} and {name[trunk[-1]]}")
    bones = [
        (f"{upper}_{side}", f"{lower}_{side}")
        for side in "lr"
        for limb in _LIMBS
        for upper, lower in itertools.pairwise(limb)
    ]
    none = [bone for bone in bones if set(bone) <= links.keys() and not apart(*bone)]
    if not none:
        return recording
    places = listed([f"{name[upper]} to {name[lower]}" for upper, lower in none])
    return recording.warn(
        f"bones without length: {places}; the turn of the joint above places "
        f"{listed([lower for _, lower in none])}, so check the clip"
    )


def bone_length(rest: np.ndarray, links: Mapping[str, int], first: str, second: str) -> float:
    """Distance of two links' joints in the zero pose [N, 3]; 0 where it is next to nothing."""
    length = float(np.linalg.norm(rest[links[first]] - rest[links[second]]))
    size = float(np.ptp(rest[list(links.values())], axis=0).max())
    return length if length > _NOTHING * size else 0.0


def leg_lengths(rest: np.ndarray, links: Mapping[str, int], side: str) -> np.ndarray:
    """Lengths of thigh and shin [2]; 0 where a bone has none."""
    joints = [f"{part}_{side}" for part in _LEG]
    bones = itertools.pairwise(joints)
    return np.array([bone_length(rest, links, *bone) for bone in bones])


def guess_unit(recording: Recording, links: Mapping[str, int]) -> float:
    """The size in metres of the recording's unit, for which its legs are an adult's."""
    bones = leg_lengths(rest_positions(recording), links, "l")
    leg = bones.sum() / max(np.mean(bones > 0), 0.5)  # of one bone alone, twice it
    return min(_UNITS_M, key=lambda unit: abs(np.log(max(leg, 1e-9) * unit / _LEG_M)))


def _no_length(recording: Recording, joints: str, more: str = "") -> MotionError:
    return MotionError(
        f"{recording.name}: joints {joints} are at one place in the file's skeleton{more}; give "
        "the bones between them their lengths (OFFSET), or map other joints with --names"
    )
