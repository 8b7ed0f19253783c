"""Starts along the reference motions, also for curves that have no motion of their own."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import jax.numpy as jnp
import mujoco
import numpy as np

from getup_jax.motion import curves
from getup_jax.motion.clips import Clip, GetUp
from getup_jax.motion.events import link_positions
from getup_jax.motion.getups import clip_features
from getup_jax.physics.character import CharacterSpec

HEIGHT_MATCH_M = 0.1  # largest gap of the neck height between a curve and a frame that fits it
ANGLE_MATCH_RAD = 0.35  # and of either torso angle
_TRIES = 256  # times along a curve that are tried


@dataclasses.dataclass(frozen=True)
class ClipFrames:
    """The F frames of all reference motions, the last of each left out."""

    qpos: np.ndarray  # [F, 7 + J]
    qvel: np.ndarray  # [F, 6 + J] towards the next frame
    features: np.ndarray  # [F, 3] height (m), side and front angle (rad)
    duration: np.ndarray  # [F] s, of the motion that the frame is from

    @classmethod
    def of(cls, getups: Sequence[GetUp], character: CharacterSpec) -> ClipFrames | None:
        """The frames of the get-ups that have a motion; None where none has."""
        clips = [getup.clip for getup in getups if getup.clip is not None]
        if not clips:
            return None
        values = [clip_features(link_positions(c, character), character)[:-1] for c in clips]
        return cls(
            qpos=np.concatenate([clip.qpos[:-1] for clip in clips]),
            qvel=np.concatenate([velocities(clip, character) for clip in clips]),
            features=np.concatenate(values),
            duration=np.concatenate([np.full(len(c.qpos) - 1, c.duration) for c in clips]),
        )

    def along(
        self, getup: GetUp, count: int, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """Frames that look like the curve at random times of it.

        Returns:
            qpos [count, 7 + J], qvel [count, 6 + J] at the curve's pace, and the time [count] (s)
            at which the curve is there; None if no frame fits at any time.
        """
        time = rng.uniform(0.0, getup.duration, _TRIES)
        target = np.asarray(
            curves.evaluate(jnp.asarray(getup.points), jnp.asarray(time / getup.duration))
        )
        limit = np.array([HEIGHT_MATCH_M, ANGLE_MATCH_RAD, ANGLE_MATCH_RAD])
        gap = np.abs(self.features[None] - target[:, None]) / limit
        fits = gap.max(axis=-1) < 1.0
        matched = np.flatnonzero(fits.any(axis=1))
        if not len(matched):
            return None
        chosen = matched[np.arange(count) % len(matched)]
        frame = np.array([rng.choice(np.flatnonzero(fits[row])) for row in chosen])
        pace = self.duration[frame] / getup.duration
        return self.qpos[frame], pace[:, None] * self.qvel[frame], time[chosen]


def velocities(clip: Clip, character: CharacterSpec) -> np.ndarray:
    """Velocities [F - 1, 6 + J] that lead from every frame to the next."""
    model = character.model
    qvel = np.zeros((len(clip.qpos) - 1, model.nv))
    for row, now, following in zip(qvel, clip.qpos, clip.qpos[1:], strict=False):
        mujoco.mj_differentiatePos(model, row, 1.0 / clip.fps, now, following)
    return qvel
