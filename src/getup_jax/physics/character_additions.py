"""What a character's MJCF file lacks and its map adds: bodies, geoms, servos, a standing pose.

add:
  bodies: {neck: {to: spine_upper, pos: [0, 0, 0.1]}}
  geoms: {foot_l: {to: foot_l, type: box, pos: [0.05, 0, -0.02], size: [0.12, 0.05, 0.01]}}
servos: {thigh: [300, 30, 120], others: [100, 10, 40]}  # of a link's hinges: kp, kv, limit (Nm)
neutral: {shin: -10, arm_l_abd: 5}                      # degrees, of a link's hinges or of one

Names are ours. A side that is left out stands for both. A geom takes the place of one of its name.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np

from getup_jax.config import ConfigError
from getup_jax.config.check import require, shown
from getup_jax.config.registry import check_name
from getup_jax.physics.requirements import lowest_of_box

ADDITIONS = ("add", "servos", "neutral")
_OTHERS = "others"
_TYPES = {name: getattr(mujoco.mjtGeom, f"mjGEOM_{name.upper()}") for name in ("sphere", "capsule")}
_TYPES |= {"box": mujoco.mjtGeom.mjGEOM_BOX}
_LENGTHS = {"pos": (3,), "quat": (4,), "size": (1, 2, 3), "fromto": (6,), "mass": (1,)}
_FIELDS = {"bodies": ("to", "pos", "quat"), "geoms": ("to", "type", *_LENGTHS)}
_LARGEST = 1e5


def add_what_lacks(spec: mujoco.MjSpec, content: Mapping[str, Any], where: str) -> None:
    """Add what a map says, in place; raises ConfigError where it is wrong."""
    added = _mapping(content.get("add"), f"{where}: add")
    for kind in added:
        check_name(str(kind), tuple(_FIELDS), f"{where}: add")
    for kind in _FIELDS:
        for name, fields in _mapping(added.get(kind), f"{where}: add: {kind}").items():
            _add(spec, kind, str(name), fields, f"{where}: add: {kind}: {name}")
    if "servos" in content:
        _add_servos(spec, content["servos"], f"{where}: servos")
    if "neutral" in content:
        _add_neutral(spec, content["neutral"], f"{where}: neutral")


def _add(spec: mujoco.MjSpec, kind: str, name: str, content: Any, where: str) -> None:
    content = _mapping(content, where)
    for field in content:
        check_name(str(field), _FIELDS[kind], where)
    values: dict[str, Any] = {
        field: _numbers(content[field], lengths, f"{where}: {field}")
        for field, lengths in _LENGTHS.items()
        if field in content
    }
    parent = spec.body(str(content.get("to")))
    if parent is None:
        known = [body.name for body in spec.bodies]
        raise ConfigError(f"{where}: to: expected one of {known}, got {shown(content.get('to'))}")
    if kind == "bodies":
        require(spec.body(name) is None, where, "a body that the file has not", name)
        parent.add_body(name=name, **values)
        return
    type_name = str(content.get("type", "capsule"))
    check_name(type_name, tuple(_TYPES), f"{where}: type")
    if "mass" in values:
        values["mass"] = values["mass"][0]
    if "size" in values:
        values["size"] = np.pad(values["size"], (0, 3 - len(values["size"])))
    if (old := spec.geom(name)) is not None:
        spec.delete(old)
    parent.add_geom(name=name, type=_TYPES[type_name], **values)


def _add_servos(spec: mujoco.MjSpec, content: Any, where: str) -> None:
    """A position servo for every hinge, in the hinges' order, in place of all actuators."""
    gains = _mapping(content, where)
    for actuator in list(spec.actuators):
        spec.delete(actuator)
    for key in list(spec.keys):  # they have values for the old actuators
        key.ctrl = []
    hinges = _hinges(spec)
    _check_used(gains, hinges, where)
    for hinge, link in hinges.items():
        values = _of_hinge(gains, hinge, link, gains.get(_OTHERS))
        if values is None:
            raise ConfigError(f"{where}: none for hinge {hinge!r}; add {link} or {_OTHERS}")
        kp, kv, limit = _numbers(values, (3,), f"{where}: {link}")
        require(min(kp, limit) > 0 <= kv, f"{where}: {link}", "kp, kv, limit above 0", values)
        servo = spec.add_actuator(name=hinge, target=hinge, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        servo.set_to_position(kp=kp, kv=kv)
        servo.forcelimited, servo.forcerange[:] = True, (-limit, limit)


def _add_neutral(spec: mujoco.MjSpec, content: Any, where: str) -> None:
    """The keyframe `neutral`, upright with its soles on z = 0, in place of all keyframes."""
    angles = _mapping(content, where)
    for key in list(spec.keys):
        spec.delete(key)
    hinges = _hinges(spec)
    _check_used(angles, hinges, where, others=False)
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[:7] = 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0
    for hinge, link in hinges.items():
        value = _of_hinge(angles, hinge, link, 0.0)
        (degrees,) = _numbers(value, (1,), f"{where}: {hinge}")
        low, high = model.joint(hinge).range
        data.joint(hinge).qpos[0] = np.clip(np.radians(degrees), low, high)
    mujoco.mj_kinematics(model, data)
    data.qpos[2] = -min(_lowest(model, data, f"foot_{side}") for side in "lr")
    spec.add_key(name="neutral", qpos=data.qpos.copy())


def _lowest(model: mujoco.MjModel, data: mujoco.MjData, name: str) -> float:
    """That of a box by its name; 0 where there is none, which is said later."""
    index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, name)
    return 0.0 if index < 0 else lowest_of_box(model, data, index)


def _hinges(spec: mujoco.MjSpec) -> dict[str, str]:
    """{hinge: link} in the order of the model."""
    model = spec.compile()
    return {
        model.joint(i).name: model.body(int(model.jnt_bodyid[i])).name
        for i in range(model.njnt)
        if model.jnt_type[i] == mujoco.mjtJoint.mjJNT_HINGE
    }


def _of_hinge(values: Mapping[str, Any], hinge: str, link: str, default: Any) -> Any:
    """The value of a hinge: its own, that of its link, or that of both sides."""
    names = (hinge, _both(hinge), link, _both(link))
    return next((values[name] for name in names if name in values), default)


def _both(name: str) -> str:
    """The name without its side."""
    return name.replace("_l_", "_").replace("_r_", "_").removesuffix("_l").removesuffix("_r")


def _check_used(
    values: Mapping[str, Any], hinges: Mapping[str, str], where: str, others: bool = True
) -> None:
    names = {*hinges, *hinges.values()}
    names |= {_both(name) for name in names}
    for name in values:
        check_name(str(name), (*sorted(names), *([_OTHERS] if others else [])), where)


def _mapping(content: Any, where: str) -> Mapping[str, Any]:
    if content is not None and not isinstance(content, Mapping):
        raise ConfigError(f"{where}: expected {{name: value}}, got {shown(content)}")
    return content or {}


def _numbers(content: Any, lengths: tuple[int, ...], where: str) -> list[float]:
    values = content if isinstance(content, list) else [content]
    good = all(isinstance(v, int | float) and not isinstance(v, bool) for v in values)
    if len(values) not in lengths or not good or not all(abs(v) < _LARGEST for v in values):
        count = " or ".join(str(n) for n in lengths)
        raise ConfigError(f"{where}: expected {count} finite numbers, got {shown(content)}")
    return [float(value) for value in values]
