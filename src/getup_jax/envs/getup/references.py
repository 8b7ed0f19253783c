"""Motions that the curves are followed along: their own, or the one that looks most like them."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import mujoco
import numpy as np
from scipy.ndimage import uniform_filter1d

from getup_jax.motion.clips import Clip, GetUp
from getup_jax.motion.getup import curves
from getup_jax.motion.getup.curve_alignment import FEATURE_SCALE, warp
from getup_jax.motion.getup.events import link_positions
from getup_jax.motion.getup.getups import clip_features
from getup_jax.physics.character import CharacterSpec

SAMPLES = 96  # times at which a curve and a motion are compared
_SMOOTH = 9  # of them, over which the pace along a motion is evened out


@dataclasses.dataclass(frozen=True)
class Reference:
    """A motion at the pace of a curve."""

    clip: Clip  # of the curve's duration
    gap: np.ndarray  # [F] to the curve, the worst feature in units of FEATURE_SCALE

    @property
    def starts(self) -> np.ndarray:
        """Frames that look like the curve and have a next one."""
        return np.flatnonzero(self.gap[:-1] < 1.0)


def make_references(
    getups: Sequence[GetUp], character: CharacterSpec
) -> tuple[Reference | None, ...]:
    """The reference of every get-up; None for curves alone where no get-up has a motion."""
    clips = [getup.clip for getup in getups if getup.clip is not None]
    values = [clip_features(link_positions(clip, character), character) for clip in clips]
    return tuple(_reference(getup, clips, values, character) for getup in getups)


def _reference(
    getup: GetUp, clips: Sequence[Clip], values: Sequence[np.ndarray], character: CharacterSpec
) -> Reference | None:
    if getup.clip is not None:
        return Reference(getup.clip, np.zeros(len(getup.clip.qpos)))
    if not clips:
        return None
    curve = curves.evaluate(getup.points, np.linspace(0.0, 1.0, SAMPLES))
    warps = [warp(curve, value) for value in values]
    best = int(np.argmin([cost for _, cost in warps]))
    qpos = between_frames(clips[best], uniform_filter1d(warps[best][0].astype(float), _SMOOTH))
    name = f"{getup.name} along {clips[best].name}"
    clip = Clip(name, (SAMPLES - 1) / getup.duration, qpos, clips[best].source)
    value = clip_features(link_positions(clip, character), character)
    return Reference(clip, (np.abs(curve - value) / FEATURE_SCALE).max(axis=-1))


def between_frames(clip: Clip, place: np.ndarray) -> np.ndarray:
    """Poses [N, 7 + J] at places [N] between a clip's frames, counted in frames."""
    low = np.clip(np.floor(place).astype(int), 0, len(clip.qpos) - 2)
    share = (place - low)[:, None]
    before, after = clip.qpos[low], clip.qpos[low + 1].copy()
    after[:, 3:7] *= np.where((before[:, 3:7] * after[:, 3:7]).sum(axis=1) < 0, -1, 1)[:, None]
    qpos = (1.0 - share) * before + share * after
    qpos[:, 3:7] /= np.linalg.norm(qpos[:, 3:7], axis=1, keepdims=True)
    return qpos


def velocities(clip: Clip, character: CharacterSpec) -> np.ndarray:
    """Velocities [F - 1, 6 + J] that lead from every frame to the next."""
    model = character.model
    qvel = np.zeros((len(clip.qpos) - 1, model.nv))
    for row, now, following in zip(qvel, clip.qpos, clip.qpos[1:], strict=False):
        mujoco.mj_differentiatePos(model, row, 1.0 / clip.fps, now, following)
    return qvel
