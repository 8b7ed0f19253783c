"""Which joint of a recording is which of our links.

Links are named as in the shipped character. Limbs are found by the words in a joint's name,
without a prefix that the joints share; the spine by its place in the tree, since formats count
vertebrae differently. A map {joint: link} in YAML or JSON overrides both; null ignores a joint.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from getup_jax.config import yaml_text
from getup_jax.config.check import shown
from getup_jax.motion.clips import MotionError
from getup_jax.motion.retarget.name_prefixes import without_prefix

# Words for a limb's joint, best first, after the side is taken off.
_LIMBS: dict[str, tuple[str, ...]] = {
    "thigh": ("thigh", "upleg", "upperleg", "femur", "hip", "thighbend"),
    "shin": ("shin", "leg", "lowerleg", "knee", "tibia", "calf", "lowleg"),
    "foot": ("foot", "ankle"),
    "toe": ("toe", "toes", "toebase", "ball", "toe0"),
    "shoulder": ("shoulder", "collar", "clavicle"),
    "arm": ("arm", "upperarm", "uparm", "humerus", "shldr", "shldrbend"),
    "forearm": ("forearm", "lowerarm", "elbow", "radius", "lowarm", "forearmbend"),
    "hand": ("hand", "wrist"),
}
_MIDDLE: dict[str, tuple[str, ...]] = {
    "pelvis": ("pelvis", "hips", "hip", "root"),
    "head": ("head",),
    "neck": ("neck1", "upperneck", "neck", "lowerneck"),  # CMU's Neck lies on the spine
}
_ALIASES = {alias for aliases in _LIMBS.values() for alias in aliases}
_SHOWN = 60  # names in a message
_SPINE = ("spine_low", "spine_mid", "spine_upper")
LINKS = (
    *("pelvis", *_SPINE, "neck", "head"),
    *(f"{limb}_{side}" for side in "lr" for limb in _LIMBS),
)
REQUIRED = (
    "pelvis",
    *(f"{limb}_{side}" for side in "lr" for limb in ("thigh", "shin", "foot", "arm", "forearm")),
)


def map_names(
    joints: Sequence[str], parents: Sequence[int], user: Mapping[str, str | None] | None = None
) -> dict[str, int]:
    """{link: joint index} for the joints that are recognised, `user` first."""
    given = _user_links(joints, user or {})
    taken = set(given.values()) | {i for i, name in enumerate(joints) if name in (user or {})}
    found = []
    for names in without_prefix(joints, len(REQUIRED)):
        words = [_words(name) for name in names]
        links, used = _recognised(words, dict(given), set(taken))
        _prefer_upper(links, used, words, parents, given)
        found.append(_add_trunk(links, used, parents))
    return max(found, key=len)  # the first of several, so that no prefix goes without a gain


def _recognised(
    words: Sequence[tuple[str, str]], found: dict[str, int], taken: set[int]
) -> tuple[dict[str, int], set[int]]:
    """Limbs, pelvis, neck and head by the words of their names, and the joints that are taken."""
    wanted = [(link, "", alias) for link, alias in _MIDDLE.items()]
    wanted += [(f"{k}_{side}", side, alias) for side in "lr" for k, alias in _LIMBS.items()]
    place = {word: i for i, word in reversed(list(enumerate(words))) if i not in taken}

    def find(link: str, side: str, aliases: Sequence[str]) -> None:
        keys = [(side, alias) for alias in aliases]
        index = next((place[key] for key in keys if place.get(key, -1) not in {-1, *taken}), None)
        if index is not None and link not in found:
            found[link] = index
            taken.add(index)

    for link, side, aliases in wanted:
        find(link, side, aliases)
    for side in "lr":  # formats without a clavicle, or with a collar, call the arm's a shoulder
        if f"arm_{side}" not in found and f"shoulder_{side}" in found:
            found[f"arm_{side}"] = found.pop(f"shoulder_{side}")
            find(f"shoulder_{side}", side, _LIMBS["shoulder"])
    return found, taken


def _prefer_upper(
    found: dict[str, int],
    taken: set[int],
    words: Sequence[tuple[str, str]],
    parents: Sequence[int],
    given: Mapping[str, int],
) -> None:
    """Where an ankle carries a foot, as in SMPL, the foot's joint is the toes'; so for wrists."""
    for link, upper, lower in (("foot", "ankle", "toe"), ("hand", "wrist", "")):
        for side in "lr":
            own, key = f"{link}_{side}", (side, upper)
            joint = words.index(key) if key in words else -1
            if own not in found or own in given or joint < 0 or joint in taken:
                continue
            if joint in _path(found[own], -1, parents)[:-1]:
                if lower:
                    found.setdefault(f"{lower}_{side}", found[own])
                found[own] = joint
                taken.add(joint)


def require_links(source: str, joints: Sequence[str], found: Mapping[str, int]) -> None:
    """MotionError that lists what is missing, what is unknown and how to give a map."""
    missing = [link for link in REQUIRED if link not in found]
    if missing:
        raise MotionError(
            f"{source}: no joint found for {', '.join(missing)}; unknown joints: "
            f"{listed(unknown_joints(joints, found)) or 'none'}; give --names MAP, a YAML "
            f"file with lines such as '{joints[0]}: pelvis' (links: {', '.join(LINKS)})"
        )


def unknown_joints(joints: Sequence[str], found: Mapping[str, int]) -> list[str]:
    """The joints that no link uses."""
    used = set(found.values())
    return [name for i, name in enumerate(joints) if i not in used]


def listed(names: Sequence[str], most: int = _SHOWN) -> str:
    """The names with commas between them, `most` of them."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def read_map(path: str | Path) -> dict[str, str | None]:
    """A user's {joint: link} file, YAML or JSON."""
    try:
        text = Path(path).read_bytes()
        values = json.loads(text) if str(path).endswith(".json") else yaml_text.parse(text)
    except OSError as error:
        problem = error.strerror or error
        raise MotionError(f"{path}: not a readable name map: {problem}") from None
    except (ValueError, RecursionError) as error:
        problem = " ".join(str(error).split())
        raise MotionError(f"{path}: not a readable name map: {problem}") from None
    if not isinstance(values, dict):
        raise MotionError(
            f"{path}: expected lines such as 'LeftUpLeg: thigh_l', got {shown(values)}"
        )
    bad = sorted(str(v) for v in values.values() if v is not None and v not in LINKS)
    if bad:
        raise MotionError(f"{path}: unknown links {listed(bad)}; links are {', '.join(LINKS)}")
    return {str(key): value for key, value in values.items()}


def _user_links(joints: Sequence[str], user: Mapping[str, str | None]) -> dict[str, int]:
    absent = [name for name in user if name not in joints]
    if absent:
        raise MotionError(f"name map: no joints {listed(absent)}; the file has {listed(joints)}")
    return {link: list(joints).index(name) for name, link in user.items() if link is not None}


def _words(name: str) -> tuple[str, str]:
    """(side, rest): `rig:LeftUpLeg`, `UpperLeg_L`, `thigh_l`, `left_leg` and `lfemur` alike."""
    name = re.sub(r"^(.*[:|/\\]|joint_|jnt_|bip01[ _]?)", "", name, flags=re.IGNORECASE)
    parts = re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", name)
    parts = [str(int(part)) if part.isdecimal() else part.lower() for part in parts]
    for mark, side in (("left", "l"), ("right", "r"), ("l", "l"), ("r", "r")):
        if mark in parts:
            parts.remove(mark)
            return side, "".join(parts)
    if len(parts) > 1 and "c" in (parts[0], parts[-1]):  # C_Hips: the centre, where L and R are
        parts.remove("c")
    bare = "".join(parts)
    for mark in ("left", "right", "l", "r"):
        if bare.startswith(mark) and bare[len(mark) :] in _ALIASES:
            return mark[0], bare[len(mark) :]
    return "", bare


def _add_trunk(found: dict[str, int], taken: set[int], parents: Sequence[int]) -> dict[str, int]:
    """The spine is what lies between the pelvis and the joint that carries the arms.

    A pelvis without a name is the joint that carries both legs, and a head the neck's only child.
    """
    if "pelvis" not in found and "thigh_l" in found and "thigh_r" in found:
        legs = [_path(found[f"thigh_{side}"], -1, parents)[:-1] for side in "lr"]
        both = [joint for joint in legs[0] if joint in legs[1] and joint not in taken]
        if both:
            found["pelvis"] = both[-1]
    if "head" not in found and "neck" in found:
        above = [i for i, parent in enumerate(parents) if parent == found["neck"]]
        if len(above) == 1 and above[0] not in taken:
            found["head"] = above[0]
    if "pelvis" not in found or "arm_l" not in found:
        return found
    ends = [found.get(f"shoulder_{s}", found.get(f"arm_{s}")) for s in "lr"]
    paths = [_path(end, found["pelvis"], parents) for end in ends if end is not None]
    below = {found["pelvis"], *taken, *_path(found["pelvis"], -1, parents)}
    spine = [joint for joint in paths[0][:-1] if all(joint in path[:-1] for path in paths)]
    spine = [joint for joint in spine if joint not in below]
    low, *mid = spine[:-1] or [None]
    for link, joint in zip(_SPINE, (low, mid[-1] if mid else None, *spine[-1:]), strict=False):
        if joint is not None:
            found.setdefault(link, joint)
    return found


def _path(joint: int, ancestor: int, parents: Sequence[int]) -> list[int]:
    """Joints from below the ancestor down to the joint."""
    path = []
    while joint not in (ancestor, -1):
        path.append(joint)
        joint = parents[joint]
    return path[::-1]
