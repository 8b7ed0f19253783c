"""How far a get-up is from the motion that its curves were taken from.

What [T, figure 3.3] shows side by side is measured here: mean link distance after dynamic time
warping. The place on the floor and the heading are left out, as curves do not control them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from getup_jax.envs.getup.references import between_frames
from getup_jax.motion.clips import GetUp
from getup_jax.motion.dtw import heading_positions, imitation_error
from getup_jax.physics.character import CharacterSpec

_STRIDE = 3  # control steps between two poses that are compared


def reference_errors(
    trace: Any, getup: np.ndarray, getups: Sequence[GetUp], character: CharacterSpec
) -> np.ndarray:
    """Mean distance of a link [N] (m) while rising; trace as in `rollout.Trace`, getup [N].

    The motion is played in the episode's duration, and may be followed at half to twice that pace.
    NaN where a style has no motion of its own, and where the episode ended before its curve did.
    """
    found = np.full(len(getup), np.nan)
    whole = _rises_to_the_end(trace)
    for episode in np.flatnonzero(whole):
        clip = getups[getup[episode]].clip
        phase = trace.time[:, episode] / trace.duration[0, episode]
        rising = np.flatnonzero(phase <= 1.0)[::_STRIDE]
        if clip is None or len(rising) < 3:
            continue
        motion = _places(trace.qpos[rising, episode], character)
        reference = between_frames(clip, phase[rising] * (len(clip.qpos) - 1))
        found[episode] = imitation_error(motion[None], _places(reference, character))[0]
    return found


def _rises_to_the_end(trace: Any) -> np.ndarray:
    """Episodes [N] that were still running when their curve was over."""
    return (trace.running & (trace.time > trace.duration)).any(axis=0)


def _places(poses: np.ndarray, character: CharacterSpec) -> np.ndarray:
    """Link positions [F, L, 3] (m) of poses [F, 7 + J], seen from the root's place and heading."""
    data = mujoco.MjData(character.model)
    position, turn = [], []
    for pose in np.asarray(poses, np.float64):
        data.qpos[:] = pose
        mujoco.mj_kinematics(character.model, data)
        position.append(data.xpos[1 : 1 + len(character.link_names)].copy())
        turn.append(data.xquat[1 : 1 + len(character.link_names)].copy())
    return heading_positions(np.stack(position), np.stack(turn))
