"""Where each link of a character should be: the recording's pose on the character's bones."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np

from getup_jax.motion.io.recording import Recording, forward, rest_positions
from getup_jax.motion.retarget.body import Body, hull_heights
from getup_jax.motion.retarget.bone_lengths import bone_length, leg_lengths
from getup_jax.motion.retarget.calibrate import anatomical_frames

_TRUNK = ("spine_low", "spine_mid", "spine_upper", "neck")
_BONES = {"head": "neck"} | {
    f"{child}_{side}": f"{parent}_{side}"
    for side in "lr"
    for child, parent in (
        ("shin", "thigh"),
        ("foot", "shin"),
        ("forearm", "arm"),
        ("hand", "forearm"),
    )
}
_STANDING = 0.8  # of the neutral pelvis height: the character stands
_FLAT_COSINE = 0.97  # between the up axis of a flat foot and up


@dataclasses.dataclass(frozen=True, eq=False)
class Targets:
    """Wanted link poses of every frame; links that the recording lacks have weight 0."""

    fps: float
    position: np.ndarray  # [F, L, 3] m, as recorded
    above: np.ndarray  # [F, L] m, how much higher the link must be to stay above the floor
    rotation: np.ndarray  # [F, L, 3, 3] link to world
    names: dict[int, str]  # link index -> our name, for the links that have a target


def make_targets(
    recording: Recording, links: Mapping[str, int], body: Body, floor: float | None = None
) -> Targets:
    """Targets of every frame of a recording.

    Bone directions and link orientations are the recording's; bone lengths are the
    character's. The root moves as far as the legs' lengths say. `floor` is the height of the
    recording's floor (m, in the recording); None: where its feet stand.
    """
    maker = _Maker(recording, links, body)
    position, rotation = maker.positions(), maker.rotations
    names = {body.links[link]: link for link in position}
    count = len(body.character.link_names)
    targets = Targets(
        fps=recording.fps,
        position=np.zeros((recording.num_frames, count, 3)),
        above=np.zeros((recording.num_frames, count)),
        rotation=np.tile(np.eye(3), (recording.num_frames, count, 1, 1)),
        names=names,
    )
    for index, link in names.items():
        targets.position[:, index] = position[link]
        targets.rotation[:, index] = rotation[link]
    level = _floor_level(targets, body) if floor is None else maker.scale * floor
    targets.position[..., 2] -= level
    heights = hull_heights(targets.position, targets.rotation, body)
    for index in names:
        own = heights[:, body.hull.link == index]
        targets.above[:, index] = np.maximum(-own.min(axis=1, initial=0.0), 0.0)
    return targets


class _Maker:
    """The steps from joint rotations to target positions."""

    def __init__(self, recording: Recording, links: Mapping[str, int], body: Body) -> None:
        self.body, self.links = body, links
        self.position, turns = forward(recording)
        self.rest = rest_positions(recording)
        frames = anatomical_frames(recording, links)
        self.rotations = {
            link: turns[:, joint] @ frames[link] @ body.frames[link].T
            for link, joint in links.items()
            if link in body.links
        }
        self.scale = self._ratio()
        self.chest = next(n for n in ("spine_upper", "spine_mid", "pelvis") if n in self.rotations)

    def _ratio(self) -> float:
        """The character's length of the legs over the recording's, of bones that have a length."""
        ours, theirs = (
            np.stack([leg_lengths(rest, at, side) for side in "lr"])
            for rest, at in ((self.body.rest, self.body.links), (self.rest, self.links))
        )
        return float(ours[theirs > 0].sum() / theirs.sum())

    def positions(self) -> dict[str, np.ndarray]:
        """{link: [F, 3]} for every link that both sides have."""
        hips = 0.5 * (self._source("thigh_l") + self._source("thigh_r"))
        centre = self.scale * hips
        place = {"pelvis": centre - self._turn("pelvis", self._hips())}
        for side in "lr":
            place[f"thigh_{side}"] = self._rigid(place, f"thigh_{side}", "pelvis", "pelvis")
        place |= self._trunk(centre, hips)
        base = "neck" if "neck" in place else self.chest
        for side in "lr":
            shoulder, arm = f"shoulder_{side}", f"arm_{side}"
            has_shoulder = bool(self._both((shoulder,)))
            if has_shoulder:
                place[shoulder] = self._rigid(place, shoulder, base, self.chest)
            above = (shoulder, shoulder) if has_shoulder else (base, self.chest)
            place[arm] = self._rigid(place, arm, *above)
        for link in self._both(tuple(_BONES)):
            parent = _BONES[link]
            if parent in place and not bone_length(self.rest, self.links, parent, link):
                place[link] = self._rigid(place, link, parent, parent)
            elif parent in place:
                way = self._source(link) - self._source(parent)
                length = np.linalg.norm(way, axis=-1, keepdims=True)
                place[link] = place[parent] + way / np.maximum(length, 1e-9) * self._length(link)
        return place

    def _both(self, links: tuple[str, ...]) -> list[str]:
        return [link for link in links if link in self.links and link in self.body.links]

    def _source(self, link: str) -> np.ndarray:
        return self.position[:, self.links[link]]

    def _ours(self, link: str) -> np.ndarray:
        return self.body.rest[self.body.links[link]]

    def _hips(self) -> np.ndarray:
        return 0.5 * (self._ours("thigh_l") + self._ours("thigh_r")) - self._ours("pelvis")

    def _length(self, link: str) -> float:
        return float(np.linalg.norm(self._ours(link) - self._ours(_BONES[link])))

    def _turn(self, link: str, vector: np.ndarray) -> np.ndarray:
        """A vector of the zero pose, turned as the link is: [F, 3]."""
        return self.rotations[link] @ vector

    def _rigid(
        self, place: Mapping[str, np.ndarray], link: str, parent: str, turned: str
    ) -> np.ndarray:
        return place[parent] + self._turn(turned, self._ours(link) - self._ours(parent))

    def _trunk(self, centre: np.ndarray, hips: np.ndarray) -> dict[str, np.ndarray]:
        """Links from the hips to the neck: on the recording's spine line, scaled as a whole.

        Vertebrae are counted and spaced differently everywhere, so a link's target is the
        point of that line at the link's own share of the trunk's length.
        """
        known = self._both(_TRUNK)
        if not known:
            return {}
        line = np.stack([hips, *(self._source(link) for link in known)], axis=1)  # [F, k, 3]
        source_at, rest_length = self._shares(self.rest, self.links, known)
        own_at, own_length = self._shares(self.body.rest, self.body.links, known)
        way = own_length / rest_length * (line - hips[:, None])
        place = {}
        for link, share in zip(known, own_at[1:], strict=True):
            after = min(int(np.searchsorted(source_at, share)), len(known))
            before = max(after - 1, 0)
            part = (share - source_at[before]) / max(source_at[after] - source_at[before], 1e-9)
            place[link] = centre + (1 - part) * way[:, before] + part * way[:, after]
        return place

    def _shares(
        self, rest: np.ndarray, at: Mapping[str, int], known: list[str]
    ) -> tuple[np.ndarray, float]:
        """Where along the hips-to-neck line each link lies [1 + k], 0 to 1, and its length."""
        hips = 0.5 * (rest[at["thigh_l"]] + rest[at["thigh_r"]])
        points = np.stack([hips, *(rest[at[link]] for link in known)])
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        return along / along[-1], float(along[-1])


def _floor_level(targets: Targets, body: Body) -> float:
    """Height of the floor under a flat foot while the character stands.

    Measured at the ankle: a sole's edge dips below the floor when a flat foot tilts a little.
    A clip that never stands is taken to lie or crawl on its lowest points.
    """
    hull, feet = body.hull, [body.links["foot_l"], body.links["foot_r"]]
    depths = [(hull.radius - hull.point[:, 2])[hull.link == foot].max() for foot in feet]
    below = targets.position[:, feet, 2] - np.array(depths)  # [F, 2]
    lower, level = below.argmin(axis=1)[:, None], below.min(axis=1)
    height = targets.position[:, body.links["pelvis"], 2] - level
    standing = height > _STANDING * body.character.neutral_qpos[2]
    if not standing.any():
        known = np.isin(hull.link, list(targets.names))
        lowest = hull_heights(targets.position, targets.rotation, body)[:, known].min(axis=1)
        return float(np.median(lowest))
    up = np.take_along_axis(targets.rotation[:, feet, 2, 2], lower, axis=1)[:, 0]
    flat = standing & (up > _FLAT_COSINE)
    enough = flat.sum() > 0.1 * standing.sum()
    return float(np.percentile(level[flat if enough else standing], 20))
