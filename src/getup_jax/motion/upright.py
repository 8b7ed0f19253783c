"""Which axis of a file is the vertical one: what its skeleton and its motion show."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np

from getup_jax.motion.names import REQUIRED, map_names
from getup_jax.motion.skeleton import Recording, forward, rest_positions

_AXES = {"y": 1, "z": 2}
_ALONG = 0.8  # cosine between the way from the feet to the arms and the axis
_LOOKS = 300  # frames that are looked at
# The lowest joint stays on the floor: its height varies by less than the first, in leg lengths,
# and what is no height by more than the second.
_FLOOR, _NO_FLOOR = 0.2, 0.4
_STANDS = 0.1  # share of the frames


def vertical_axis(recording: Recording) -> str | None:
    """y or z in the file's axes, or None where neither skeleton nor motion says."""
    links = map_names(recording.joint_names, recording.parents)
    if any(link not in links for link in REQUIRED) or not recording.num_frames:
        return None
    rest = _upwards(rest_positions(recording)[None], links)
    for name, axis in _AXES.items():
        if rest[0, axis] > _ALONG:
            return name
    return _by_motion(recording, links)


def _upwards(position: np.ndarray, links: Mapping[str, int]) -> np.ndarray:
    """Directions [F, 3] from the feet to the arms' roots."""
    feet, arms = (
        np.mean([position[:, links[f"{link}_{side}"]] for side in "lr"], axis=0)
        for link in ("foot", "arm")
    )
    way = arms - feet
    return way / np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), 1e-9)


def _by_motion(recording: Recording, links: Mapping[str, int]) -> str | None:
    """The axis along which the body stands on a floor, if it is not the other one's too."""
    frames = np.unique(np.linspace(0, recording.num_frames - 1, _LOOKS).astype(int))
    seen = dataclasses.replace(
        recording,
        translations=recording.translations[frames],
        rotations=recording.rotations[frames],
    )
    position, _ = forward(seen)
    body = position[:, list(links.values())]
    leg = sum(
        np.linalg.norm(body_of_leg, axis=-1).mean()
        for body_of_leg in np.diff(
            [position[:, links[f"{name}_l"]] for name in ("thigh", "shin", "foot")], axis=0
        )
    )
    up = _upwards(position, links)
    lowest = body.min(axis=1)
    low, high = np.percentile(lowest, [5, 95], axis=0)
    varies = (high - low) / max(float(leg), 1e-9)
    for (name, axis), other in zip(_AXES.items(), (2, 1), strict=True):
        stands = np.mean(up[:, axis] > _ALONG) > _STANDS
        if stands and varies[axis] < _FLOOR and varies[other] > _NO_FLOOR:
            return name
    return None
