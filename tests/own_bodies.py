"""Maps that make characters of humanoids that packages ship."""

from __future__ import annotations

import re
from pathlib import Path

DOCUMENT = Path(__file__).resolve().parent.parent / "docs" / "character.md"
_SIDED = {
    "bodies": {"thigh": "thigh", "shin": "shin", "foot": "foot", "upper_arm": "arm"}
    | {"lower_arm": "forearm"},
    "joints": {"hip_x": "thigh_abd", "hip_z": "thigh_twist", "hip_y": "thigh_flex"}
    | {"knee": "shin_flex", "shoulder1": "arm_flex", "shoulder2": "arm_abd"}
    | {"elbow": "forearm_flex"},
    "geoms": {"shin1": "shin"},
}
_MIDDLE = {
    "bodies": {"torso": "spine_upper", "lwaist": "spine_low"},
    "joints": {"abdomen_x": "spine_low_abd", "abdomen_y": "spine_upper_flex"}
    | {"abdomen_z": "spine_upper_twist"},
    "geoms": {},
}


def documented() -> str:
    """The map of docs/character.md for dm_control's humanoid."""
    (found,) = re.findall(r"```yaml\n(.*?)```", DOCUMENT.read_text(encoding="utf-8"), re.DOTALL)
    return found


def gymnasiums() -> dict:
    """A map for Gymnasium's Humanoid, which has neither ankles nor bodies for head and hands."""
    content: dict = {"mjcf": "package:gymnasium/envs/mujoco/assets/humanoid.xml", "root": "pelvis"}
    for kind, sided in _SIDED.items():
        content[kind] = dict(_MIDDLE[kind])
        for side in ("left", "right"):
            for theirs, ours in sided.items():
                link, *axis = ours.split("_")
                content[kind][f"{side}_{theirs}"] = "_".join([link, side[0], *axis])
    bodies = {
        "neck": {"to": "spine_upper", "pos": [0, 0, 0.1]},
        "head": {"to": "spine_upper", "pos": [0, 0, 0.19]},
    }
    geoms = {"head": {"to": "head", "type": "sphere", "size": 0.09}}
    for side, sign in (("l", -1), ("r", 1)):
        bodies[f"hand_{side}"] = {"to": f"forearm_{side}", "pos": [0.18, sign * 0.18, 0.18]}
        geoms[f"hand_{side}"] = {"to": f"hand_{side}", "type": "sphere", "size": 0.04}
        geoms[f"foot_{side}"] = {"to": f"foot_{side}", "type": "box", "pos": [0.03, 0, 0.045]}
        geoms[f"foot_{side}"] |= {"size": [0.12, 0.05, 0.02], "mass": 0.5}
    return content | {
        "add": {"bodies": bodies, "geoms": geoms},
        "servos": {"thigh": [300, 30, 120], "shin_l": [301, 30, 100], "others": [150, 15, 50]},
        "neutral": {"shin": -10, "thigh_flex": -5},
    }
