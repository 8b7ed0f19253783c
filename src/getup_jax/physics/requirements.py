"""What a character's MJCF file must have, checked when it is loaded; docs/character.md lists it."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import mujoco
import numpy as np

from getup_jax.config import ConfigError

AXES = ("flex", "abd", "twist")  # behind the link in a hinge's name
_SIDES = ("l", "r")
_LIMBS = ("thigh", "shin", "foot", "arm", "forearm", "hand")
LINKS = ("pelvis", "head", *(f"{limb}_{side}" for limb in _LIMBS for side in _SIDES))
_SPHERE, _BOX = mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_BOX
_CAPSULE = mujoco.mjtGeom.mjGEOM_CAPSULE
# name of a geom -> the kind that it must be; None: any
GEOMS: dict[str, mujoco.mjtGeom | None] = {
    "head": _SPHERE,
    **{f"foot_{side}": _BOX for side in _SIDES},
    **{f"shin_{side}": _CAPSULE for side in _SIDES},
    **{f"hand_{side}": None for side in _SIDES},
    "floor": None,
}
_KINDS = {_SPHERE: "a sphere", _BOX: "a box", _CAPSULE: "a capsule", None: "of any kind"}
_SHOWN = 12  # names in a message
_SOLE_GAP_M = 0.03  # between a sole and the floor in the keyframe


def hinges_of(model: mujoco.MjModel) -> list[int]:
    """The joints that are hinges, in model order."""
    return [i for i in range(model.njnt) if model.jnt_type[i] == mujoco.mjtJoint.mjJNT_HINGE]


def check_character(model: mujoco.MjModel, name: str) -> None:
    """Raise ConfigError that says what the character of a file lacks."""
    where = f"physics.character: {name}"
    _check_layout(model, where)
    bodies = [model.body(i).name for i in range(1, model.nbody)]
    lacks = [f"body {link!r}" for link in LINKS if link not in bodies]
    geoms = {model.geom(i).name: int(model.geom_type[i]) for i in range(model.ngeom)}
    for geom, kind in GEOMS.items():
        if geom not in geoms or (kind is not None and geoms[geom] != kind):
            lacks.append(f"geom {geom!r} ({_KINDS[kind]})")
    if lacks:
        raise ConfigError(
            f"{where}: lacks {_listed(lacks)}; it has the bodies {_listed(bodies)}; "
            "docs/character.md lists what a character must have"
        )
    for hinge in hinges_of(model):
        joint, link = model.joint(hinge).name, model.body(int(model.jnt_bodyid[hinge])).name
        if joint not in [f"{link}_{axis}" for axis in AXES]:
            expected = " or ".join(f"{link}_{axis}" for axis in AXES)
            raise ConfigError(
                f"{where}: joint {joint!r} of body {link!r}: expected the name {expected}; see "
                "docs/character.md"
            )
    _warn_of_soles(model, where)


def _warn_of_soles(model: mujoco.MjModel, where: str) -> None:
    """The keyframe `neutral` stands on z = 0: starts, curves and heights count from there."""
    data = mujoco.MjData(model)
    data.qpos[:] = model.key("neutral").qpos
    mujoco.mj_kinematics(model, data)
    for name in (f"foot_{side}" for side in _SIDES):
        sole = lowest_of_box(model, data, model.geom(name).id)
        if abs(sole) > _SOLE_GAP_M:
            warnings.warn(
                f"{where}: keyframe 'neutral': expected both soles on z = 0, got {name!r} at "
                f"{sole:.2f} m; {'raise' if sole < 0 else 'lower'} the root there",
                stacklevel=4,
            )
            return


def lowest_of_box(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> float:
    """Height (m) of the lowest corner of a box, by its number."""
    up = np.abs(data.geom_xmat[geom].reshape(3, 3)[2])
    return float(data.geom_xpos[geom][2] - up @ model.geom_size[geom])


def _check_layout(model: mujoco.MjModel, where: str) -> None:
    hinges = hinges_of(model)
    free = model.njnt and model.jnt_type[0] == mujoco.mjtJoint.mjJNT_FREE
    if not free or len(hinges) != model.njnt - 1:
        raise ConfigError(f"{where}: expected one free root, then hinges only")
    if model.actuator_trnid[:, 0].tolist() != hinges:
        raise ConfigError(f"{where}: expected one actuator a hinge, in the hinges' order")
    keys = [model.key(i).name for i in range(model.nkey)]
    if "neutral" not in keys:
        raise ConfigError(f"{where}: no keyframe named 'neutral', has {keys}")
    servo = (model.actuator_gainprm[:, 0] > 0) & (model.actuator_forcerange[:, 1] > 0)
    servo &= model.actuator_biasprm[:, 1] == -model.actuator_gainprm[:, 0]
    for hinge, is_servo in zip(hinges, servo, strict=True):
        low, high = model.jnt_range[hinge]
        if not is_servo or not low < high:
            raise ConfigError(
                f"{where}: joint {model.joint(hinge).name!r}: expected a range, and a position "
                "servo with a forcerange; see docs/character.md"
            )


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return ", ".join(names[:_SHOWN]) + more
