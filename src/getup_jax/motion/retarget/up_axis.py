"""Which axis of a file is the vertical one: what its skeleton and its motion show."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np

from getup_jax.motion.io.recording import Recording, forward, rest_positions
from getup_jax.motion.retarget.bone_lengths import leg_lengths
from getup_jax.motion.retarget.joint_names import REQUIRED, map_names

_AXES = {"y": (1, 1.0), "z": (2, 1.0), "x": (0, 1.0)}
_AXES |= {f"-{name}": (axis, -1.0) for name, (axis, _) in _AXES.items()}
_ALONG = 0.8  # cosine between the way from the feet to the arms and the axis
_LOOKS = 300  # frames that are looked at
# The lowest joint stays on the floor: its height varies by less than the first, in leg lengths,
# and what is no height by more than the second.
_FLOOR, _NO_FLOOR = 0.2, 0.4
_STANDS, _MOSTLY = 0.1, 0.5  # shares of the frames


def vertical_axis(recording: Recording) -> str | None:
    """x, y or z, with a minus where it points down; None where neither skeleton nor motion says."""
    links = map_names(recording.joint_names, recording.parents)
    if any(link not in links for link in REQUIRED) or not recording.num_frames:
        return None
    rest = rest_positions(recording)
    upright = [name for name in _AXES if _is_human(rest, links, name)]
    if upright and upright[0] in ("y", "z"):
        return upright[0]
    return _by_motion(_seen(recording), links, upright)


def axis_of_motion(recording: Recording) -> str | None:
    """As `vertical_axis`, where the zero pose has other axes than the world, by the motion alone.

    The axis, y or z, along which the body stands at times, and of two the one along which its
    lowest joint stays; -y or -z where it stands along that one most of the time.
    """
    links = map_names(recording.joint_names, recording.parents)
    share, varies = _standing(_seen(recording), links)
    stands = [name for name in ("z", "y") if share[name] > _STANDS]
    if stands:
        return min(stands, key=lambda name: varies[name])
    return next((name for name in ("-y", "-z") if share[name] > _MOSTLY), None)


def _is_human(rest: np.ndarray, links: Mapping[str, int], name: str) -> bool:
    """Whether the zero pose [N, 3] has its arms' root above and its feet below the hips."""
    axis, sign = _AXES[name]
    leg = leg_lengths(rest, links, "l").sum()
    foot, hip, arm = (sign * rest[links[f"{link}_l"], axis] for link in ("foot", "thigh", "arm"))
    return bool(hip - foot > 0.7 * leg > 0 and arm - hip > 0.2 * leg)


def _seen(recording: Recording) -> Recording:
    """Some of its frames, as many as are needed."""
    frames = np.unique(np.linspace(0, recording.num_frames - 1, _LOOKS).astype(int))
    return dataclasses.replace(
        recording,
        translations=recording.translations[frames],
        rotations=recording.rotations[frames],
    )


def _standing(
    recording: Recording, links: Mapping[str, int]
) -> tuple[dict[str, float], dict[str, float]]:
    """By axis: the share of frames that stand along it, and how much the lowest joint varies there.

    The latter in leg lengths.
    """
    position, _ = forward(recording)
    feet, arms = (
        np.mean([position[:, links[f"{link}_{side}"]] for side in "lr"], axis=0)
        for link in ("foot", "arm")
    )
    way = arms - feet
    way /= np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), 1e-9)
    body = position[:, list(links.values())]
    leg = max(float(leg_lengths(rest_positions(recording), links, "l").sum()), 1e-9)
    share, varies = {}, {}
    for name, (axis, sign) in _AXES.items():
        share[name] = float(np.mean(sign * way[:, axis] > _ALONG))
        low, high = np.percentile((sign * body[..., axis]).min(axis=1), [5, 95])
        varies[name] = float(high - low) / leg
    return share, varies


def _by_motion(recording: Recording, links: Mapping[str, int], upright: list[str]) -> str | None:
    """The axis along which the body stands on a floor, or is as in the zero pose.

    A body that stays still may stand along one axis as well as lie along another.
    """
    share, varies = _standing(recording, links)
    for name in _AXES:
        other = "z" if name == "y" else "y"
        if share[name] > _STANDS and varies[name] < _FLOOR and varies[other] > _NO_FLOOR:
            return name
    likely = (n for n in upright if share[n] > _STANDS and varies[n] <= varies["y"])
    return next(likely, None)
