"""How each joint's own axes lie in the body: the same for every skeleton.

The anatomical frame of a link turns with it and equals (forward, left, up) in the hanging
pose: standing straight, arms down, elbows bending forward, feet flat. Two skeletons are in
the same pose when these frames are equal. Where the zero pose of a recording is human-like
(CMU, DeepMimic, our characters) the frames come from it. Where all bones lie along one axis
(LAFAN1, Bandai-Namco) they come from the bones and from how knees and elbows bend.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from getup_jax.motion.clips import MotionError
from getup_jax.motion.io.recording import Recording, forward, rest_positions
from getup_jax.motion.retarget.axes import frame_of, shortest_turn

UP = np.array([0.0, 0.0, 1.0])
_HANGING = ("thigh", "shin", "arm", "forearm", "hand")  # limbs that point down
_CHILD = {
    **{"thigh": "shin", "shin": "foot", "foot": "toe"},
    **{"shoulder": "arm", "arm": "forearm", "forearm": "hand"},
}
_TRUNK = ("spine_low", "spine_mid", "spine_upper", "neck", "head")
_NOTHING = 1e-3  # of the skeleton's longest bone: no length, no direction
_LEAST_BEND = 0.02  # mean squared sine of a knee or elbow that shows its axis


def anatomical_frames(recording: Recording, links: Mapping[str, int]) -> dict[str, np.ndarray]:
    """{link: [3, 3]} columns forward, left, up of the link in its joint's own axes.

    Raises MotionError where they cannot be told, as of bones that all lie in one line.
    """
    rest = rest_positions(recording)
    with np.errstate(invalid="ignore", divide="ignore"):
        human = _is_human(rest, links)
        frames = _from_rest(recording, rest, links) if human else _Moving(recording, links).frames()
    for link, frame in frames.items():
        if not np.isfinite(frame).all():
            joint = recording.joint_names[links[link]]
            raise MotionError(
                f"{recording.name}: joint {joint} ({link}): neither its bone nor the motion says "
                f"how it is turned in the body; leave it out with --names, '{joint}: null', or "
                "correct the file's skeleton"
            )
    return frames


def _is_human(rest: np.ndarray, links: Mapping[str, int]) -> bool:
    """True where the zero pose has its arms' root above and its feet below the pelvis."""
    foot, knee, hip, arm = (rest[links[n]] for n in ("foot_l", "shin_l", "thigh_l", "arm_l"))
    leg = np.linalg.norm(foot - knee) + np.linalg.norm(knee - hip)
    return bool(hip[2] - foot[2] > 0.7 * leg and arm[2] - hip[2] > 0.2 * leg)


def _from_rest(
    recording: Recording, rest: np.ndarray, links: Mapping[str, int]
) -> dict[str, np.ndarray]:
    """Frames of a human-like zero pose, in which every joint's axes are the world's."""
    left = rest[links["thigh_l"]] - rest[links["thigh_r"]]
    body = frame_of(up=UP, left=left)
    frames = {}
    for link in links:
        limb, _, side = link.partition("_")
        frames[link] = body
        bone = _bone(recording, links, link)
        if limb == "hand" and bone is None:
            frames[link] = frames.get(f"forearm_{side}", body)
        elif limb in _HANGING and bone is not None:
            frames[link] = shortest_turn(-UP, bone) @ body
        elif limb == "foot" and bone is not None and np.linalg.norm(bone[:2]) > 0.02:
            frames[link] = frame_of(up=UP, left=np.cross(UP, bone))
    return frames


def _bone(recording: Recording, links: Mapping[str, int], link: str) -> np.ndarray | None:
    """The vector along a link in its own axes, to the next joint or its End Site."""
    limb, _, side = link.partition("_")
    joint, child = links[link], links.get(f"{_CHILD.get(limb)}_{side}")
    if child is not None and recording.parents[child] == joint:
        bone = recording.offsets[child]
    else:
        children = [i for i, parent in enumerate(recording.parents) if parent == joint]
        inner = recording.offsets[children[0]] if len(children) == 1 else np.zeros(3)
        bone = recording.ends.get(joint, inner)
    longest = np.abs(recording.offsets[1:]).max(initial=1e-9)
    return bone if np.linalg.norm(bone) > _NOTHING * longest else None


class _Moving:
    """Frames of a skeleton whose zero pose says nothing, from bones and from the motion."""

    def __init__(self, recording: Recording, links: Mapping[str, int]) -> None:
        self.recording, self.links = recording, links
        self.position, self.rotation = forward(recording)

    def frames(self) -> dict[str, np.ndarray]:
        """All links' frames, parents first."""
        frames = {"pelvis": self._pelvis()}
        if "spine_upper" in self.links:
            frames["spine_upper"] = self._chest()
        for link in (*_TRUNK, "shoulder_l", "shoulder_r"):
            if link in self.links and link not in frames:
                base = "pelvis" if link == "spine_low" else self._chest_of(frames)
                frames[link] = self._near(link, base, frames)
        for side in "lr":
            frames |= self._limb(("thigh", "shin"), side, 1.0, frames)
            frames |= self._limb(("arm", "forearm"), side, -1.0, frames)
            if f"hand_{side}" in self.links:
                frames[f"hand_{side}"] = frames[f"forearm_{side}"]
            frames[f"foot_{side}"] = self._foot(side, frames)
        return frames

    def _local(self, link: str, vector: np.ndarray) -> np.ndarray:
        """World vectors [F, 3] in a link's axes."""
        return np.einsum("fji,fj->fi", self.rotation[:, self.links[link]], vector)

    def _mean_local(self, link: str, target: str) -> np.ndarray:
        """The place of a joint in the axes of a link, mean over the frames."""
        way = self.position[:, self.links[target]] - self.position[:, self.links[link]]
        return self._local(link, way).mean(axis=0)

    def _chest_of(self, frames: Mapping[str, np.ndarray]) -> str:
        return "spine_upper" if "spine_upper" in frames else "pelvis"

    def _first(self, vectors: Iterable[np.ndarray]) -> np.ndarray:
        """The first vector with a direction, or zeros."""
        least = _NOTHING * np.abs(self.recording.offsets[1:]).max(initial=0.0)
        return next((v for v in vectors if np.linalg.norm(v) > least), np.zeros(3))

    def _across(self, link: str, limbs: tuple[str, ...]) -> np.ndarray:
        """From the right to the left one of the first pair that does not start in one place."""
        ways = (
            self._mean_local(link, f"{limb}_l") - self._mean_local(link, f"{limb}_r")
            for limb in limbs
            if f"{limb}_l" in self.links and f"{limb}_r" in self.links
        )
        return self._first(ways)

    def _pelvis(self) -> np.ndarray:
        """The root's own axis that is nearest to the spine: its bone may start oblique."""
        hips = [self._mean_local("pelvis", f"thigh_{side}") for side in "lr"]
        middle = 0.5 * (hips[0] + hips[1])
        above = (link for link in (*_TRUNK, "arm_l") if link in self.links)
        up = self._first(self._mean_local("pelvis", link) - middle for link in above)
        axis = np.zeros(3)
        axis[np.argmax(np.abs(up))] = np.sign(up[np.argmax(np.abs(up))])
        return frame_of(up=axis, left=hips[0] - hips[1], exact="left")

    def _chest(self) -> np.ndarray:
        """Upright along the neck, its left where the left collar or arm is."""
        above = [link for link in ("neck", "head") if link in self.links]
        tops = [self._mean_local("spine_upper", link) for link in above]
        arms = [self._mean_local("spine_upper", f"arm_{side}") for side in "lr"]
        top = self._first([*tops, arms[0] + arms[1]])
        return frame_of(up=top, left=self._across("spine_upper", ("shoulder", "arm", "forearm")))

    def _near(self, link: str, base: str, frames: Mapping[str, np.ndarray]) -> np.ndarray:
        """A trunk link: its bone points up (clavicle: aside), the rest is as `base` on average."""
        axis = self.rotation[:, self.links[base]] @ frames[base]
        bone = _bone(self.recording, self.links, link)
        left, up = (self._local(link, axis[..., i]).mean(axis=0) for i in (1, 2))
        if link.startswith("shoulder") and bone is not None:
            lateral = bone if link.endswith("_l") else -bone
            return frame_of(up=up, left=lateral, exact="left")
        if bone is None and link == "head" and "neck" in frames:
            return frames["neck"]
        return frame_of(up=up if bone is None else bone, left=left)

    def _limb(
        self, pair: tuple[str, str], side: str, sign: float, frames: Mapping[str, np.ndarray]
    ) -> dict[str, np.ndarray]:
        """Both links of a limb, from the axis about which their joint bends."""
        upper, lower = (f"{name}_{side}" for name in pair)
        bones = [_bone(self.recording, self.links, link) for link in (upper, lower)]
        # where one has no length, both lie along one axis, as in all such skeletons
        axis = next((bone for bone in bones if bone is not None), -UP)
        bones = [axis if bone is None else bone for bone in bones]
        bones = [bone / np.linalg.norm(bone) for bone in bones]
        along = [
            self.rotation[:, self.links[link]] @ bone
            for link, bone in zip((upper, lower), bones, strict=True)
        ]
        bend = sign * np.cross(along[0], along[1])
        if np.mean(bend**2) * 3 < _LEAST_BEND:  # a straight limb: as the trunk on average
            base = "pelvis" if pair[0] == "thigh" else self._chest_of(frames)
            bend = (self.rotation[:, self.links[base]] @ frames[base])[..., 1]
        both = zip((upper, lower), bones, strict=True)
        return {
            link: frame_of(up=-bone, left=self._local(link, bend).mean(axis=0))
            for link, bone in both
        }

    def _foot(self, side: str, frames: Mapping[str, np.ndarray]) -> np.ndarray:
        """Mean over the frames in which ankle and toe are lowest: there the sole is level."""
        foot, toe = f"foot_{side}", f"toe_{side}"
        if toe not in self.links or not self._first([self._mean_local(foot, toe)]).any():
            axis = self.rotation[:, self.links[f"shin_{side}"]] @ frames[f"shin_{side}"]
            left, up = (self._local(foot, axis[..., i]).mean(axis=0) for i in (1, 2))
            return frame_of(up=up, left=left)
        ankle, tip = (self.position[:, self.links[link]] for link in (foot, toe))
        flat = _flat_frames(self.position, self.links, ankle, tip)
        left = np.cross(UP, (tip - ankle)[flat])
        up = self._local(foot, np.broadcast_to(UP, ankle.shape))[flat].mean(axis=0)
        return frame_of(up=up, left=self._local_at(foot, flat, left).mean(axis=0))

    def _local_at(self, link: str, frames: np.ndarray, vector: np.ndarray) -> np.ndarray:
        return np.einsum("fji,fj->fi", self.rotation[frames, self.links[link]], vector)


def _flat_frames(
    position: np.ndarray, links: Mapping[str, int], ankle: np.ndarray, tip: np.ndarray
) -> np.ndarray:
    """Indices of the frames with a high pelvis in which ankle plus toe are lowest."""
    height = position[:, links["pelvis"], 2] - np.minimum(ankle[:, 2], tip[:, 2])
    standing = np.flatnonzero(height > 0.8 * height.max())
    sole = (ankle[:, 2] + tip[:, 2])[standing]
    return standing[np.argsort(sole)[: max(1, len(sole) // 5)]]
