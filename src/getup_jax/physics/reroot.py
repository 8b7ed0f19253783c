"""A body whose free joint is not at the pelvis, hung up by its pelvis: the same mechanism.

Many humanoids begin at the torso. The bodies between the torso and the pelvis change their order,
and the hinges between them act the other way round.
"""

from __future__ import annotations

import itertools
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from pathlib import Path
from xml.etree.ElementTree import Element

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from getup_jax.config import ConfigError


def rerooted(spec: mujoco.MjSpec, root: str, where: str) -> mujoco.MjSpec:
    """The same bodies with `root` as the free one; keyframes, which have other columns, go.

    A body b in its parent is at T J1 ... Jm: its place, then its hinges. The parent in b is at

        (T J1 ... Jm)^-1 = T^-1 (T Jm^-1 T^-1) ... (T J1^-1 T^-1)

    so hinges keep their angles, about axes that are turned by T and point the other way.
    """
    model = spec.compile()
    names = [model.body(i).name for i in range(model.nbody)]
    if root not in names[1:]:
        raise ConfigError(f"{where}: root: no body {root!r}; the file has {', '.join(names[1:])}")
    way = _way(model, names.index(root))
    free = model.body_jntadr[way[0]]
    if free < 0 or model.jnt_type[free] != mujoco.mjtJoint.mjJNT_FREE:
        raise ConfigError(f"{where}: root: body {names[way[0]]!r} has no free joint to hand over")
    for folder in ("meshdir", "texturedir"):  # the text has no place that they are relative to
        setattr(spec, folder, str(Path(spec.modelfiledir, getattr(spec, folder)).resolve()))
    tree = ElementTree.fromstring(spec.to_xml())
    _turn_round(tree, model, way)
    return mujoco.MjSpec.from_string(ElementTree.tostring(tree, encoding="unicode"))


def _way(model: mujoco.MjModel, body: int) -> list[int]:
    """Bodies from the free one down to `body`."""
    way = [body]
    while model.body_parentid[way[0]]:
        way.insert(0, int(model.body_parentid[way[0]]))
    return way


def _turn_round(tree: Element, model: mujoco.MjModel, way: Sequence[int]) -> None:
    """Change the file's tree in place."""
    world = tree.find("worldbody")
    assert world is not None
    for key in tree.findall("keyframe"):
        tree.remove(key)
    for size in tree.findall("size"):
        size.attrib.pop("nkey", None)
    bodies = dict(enumerate(world.iter("body"), start=1))  # in the order of the model
    chain = [bodies[i] for i in way]
    _name_classes(bodies[way[0]], None)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    world.remove(chain[0])
    joints = [_taken(body) for body in chain]
    for upper, lower in itertools.pairwise(chain):
        upper.remove(lower)
    for k in range(len(chain) - 1, 0, -1):
        _hang(chain[k - 1], chain[k], joints[k], model, way[k])
    chain[-1].extend(joints[0])
    _place(chain[-1], data.xpos[way[-1]], data.xquat[way[-1]])
    world.append(chain[-1])


def _hang(
    upper: Element, lower: Element, joints: list[Element], model: mujoco.MjModel, body: int
) -> None:
    """Make `upper` a child of `lower`, which was its child by these joints."""
    turn = Rotation.from_quat(model.body_quat[body], scalar_first=True)
    place, first = model.body_pos[body], int(model.body_jntadr[body])
    for index, joint in reversed(list(enumerate(joints, start=first))):
        joint.set("pos", _text(turn.apply(model.jnt_pos[index]) + place))
        joint.set("axis", _text(-turn.apply(model.jnt_axis[index])))
        upper.insert(0, joint)
    upper[: len(joints)] = joints[::-1]
    _place(upper, -turn.inv().apply(place), turn.inv().as_quat(scalar_first=True))
    lower.append(upper)


def _taken(body: Element) -> list[Element]:
    """The body's joints, taken out of it."""
    joints = [child for child in body if child.tag in ("joint", "freejoint")]
    for joint in joints:
        body.remove(joint)
    return joints


def _name_classes(body: Element, inherited: str | None) -> None:
    """Say of every body and joint which default class it had from the bodies above."""
    inherited = body.get("childclass", inherited)
    if inherited is None:
        return
    body.set("childclass", inherited)
    for child in body:
        if child.tag == "body":
            _name_classes(child, inherited)
        elif child.tag == "joint" and "class" not in child.attrib:
            child.set("class", inherited)


def _place(body: Element, position: np.ndarray, quaternion: np.ndarray) -> None:
    body.set("pos", _text(position))
    body.set("quat", _text(quaternion))


def _text(values: np.ndarray) -> str:
    return " ".join(f"{float(value):.17g}" for value in values)
