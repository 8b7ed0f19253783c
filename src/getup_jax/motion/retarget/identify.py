"""Which skeleton of a recording is the body, and which of its joints are our links.

Files also hold props, cameras and markers: under a ROOT of their own, or under names that come
twice. What no link needs is left out with a warning; what a link needs must be plain.
"""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from getup_jax.motion.clips import MotionError
from getup_jax.motion.io.recording import Recording
from getup_jax.motion.retarget.joint_names import REQUIRED, listed, map_names, require_links


def identify(
    recording: Recording, names: Mapping[str, str | None] | None = None
) -> tuple[Recording, dict[str, int]]:
    """The recording of the body alone, and {link: joint index} in it.

    `names` is the user's map {joint: link}. Raises MotionError where a link that is needed has no
    joint, hangs under another ROOT or has a name that comes twice.
    """
    user = dict(names or {})
    everywhere = map_names(recording.joint_names, recording.parents, user)
    trees = _trees(recording.parents)
    if len(trees) == 1:
        body, links = recording, everywhere
    else:
        body, links = _best(recording, trees, everywhere, user)
    require_links(recording.name, body.joint_names, links)
    return _without_doubles(body, links, user), links


def _trees(parents: Sequence[int]) -> list[list[int]]:
    """The joints under each root."""
    tree_of: list[int] = []
    trees: list[list[int]] = []
    for joint, parent in enumerate(parents):
        if parent < 0:
            trees.append([])
        tree_of.append(len(trees) - 1 if parent < 0 else tree_of[parent])
        trees[tree_of[joint]].append(joint)
    return trees


def _best(
    recording: Recording,
    trees: Sequence[Sequence[int]],
    everywhere: Mapping[str, int],
    user: Mapping[str, str | None],
) -> tuple[Recording, dict[str, int]]:
    """The tree in which the most links are found; of several, the first."""
    names = recording.joint_names
    bodies = [_only(recording, tree) for tree in trees]
    found = [
        map_names(
            body.joint_names,
            body.parents,
            {joint: link for joint, link in user.items() if joint in body.joint_names},
        )
        for body in bodies
    ]
    best = max(range(len(trees)), key=lambda i: len(found[i]))
    lost = [link for link in REQUIRED if link in everywhere and link not in found[best]]
    root = names[trees[best][0]]
    if lost:
        other = names[everywhere[lost[0]]]
        raise MotionError(
            f"{recording.name}: joint {other} does not hang under ROOT {root} with the rest of the "
            "body; export one skeleton under one ROOT"
        )
    left = [f"{names[tree[0]]} ({len(tree)} joints)" for i, tree in enumerate(trees) if i != best]
    text = f"only the skeleton under ROOT {root} is used; left out: {listed(left)}"
    return bodies[best].warn(text), found[best]


def _only(recording: Recording, joints: Sequence[int]) -> Recording:
    """The recording of some joints, whose parents are among them."""
    place = {joint: index for index, joint in enumerate(joints)}
    chosen = np.array(joints)
    return dataclasses.replace(
        recording,
        joint_names=tuple(recording.joint_names[joint] for joint in joints),
        parents=tuple(place.get(recording.parents[joint], -1) for joint in joints),
        offsets=recording.offsets[chosen],
        translations=recording.translations[:, chosen],
        rotations=recording.rotations[:, chosen],
        ends={place[joint]: end for joint, end in recording.ends.items() if joint in place},
    )


def _without_doubles(
    recording: Recording, links: Mapping[str, int], user: Mapping[str, str | None]
) -> Recording:
    """The recording with a warning of names that come twice, if no link needs one of them."""
    count = Counter(recording.joint_names)
    twice = [name for name, times in count.items() if times > 1]
    if not twice:
        return recording
    for link, joint in links.items():
        name = recording.joint_names[joint]
        if name in twice and (name in user or not link.startswith("spine")):
            raise MotionError(
                f"{recording.name}: joint {name} appears twice, and {link} needs it; rename one "
                "of the two"
            )
    used = {recording.joint_names[joint] for joint in links.values()}
    left = [name for name in twice if name not in used]
    if not left:
        return recording
    return recording.warn(f"joints that appear twice are left out: {listed(left)}")
