from __future__ import annotations

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from getup_jax.config import PhysicsConfig
from getup_jax.envs.getup.references import between_frames
from getup_jax.evaluation.reference_error import reference_errors
from getup_jax.motion.authoring.library import load_authored
from getup_jax.physics.character import CharacterSpec, load_character

DT = 1 / 30
STAND_S = 1.0


@pytest.fixture(scope="module")
def character() -> CharacterSpec:
    return load_character(PhysicsConfig())


@pytest.fixture(scope="module")
def getups(character):
    return load_authored(character)


def played(getup, share, turn_rad=0.0, away_m=0.0) -> SimpleNamespace:
    """An episode that is at `share` (of the phase 0 to 1) of the motion, and then stands."""
    steps = round((getup.duration + STAND_S) / DT)
    time = DT * np.arange(1, steps + 1)
    phase = np.clip(share(np.minimum(time / getup.duration, 1.0)), 0.0, 1.0)
    qpos = between_frames(getup.clip, phase * (len(getup.clip.qpos) - 1))
    turn = np.array([np.cos(turn_rad / 2), 0.0, 0.0, np.sin(turn_rad / 2)])
    for pose in qpos:
        mujoco.mju_mulQuat(pose[3:7], turn, pose[3:7].copy())
        mujoco.mju_rotVecQuat(pose[:3], pose[:3].copy(), turn)
    qpos[:, 0] += away_m
    column = np.ones((steps, 1))
    return SimpleNamespace(
        qpos=qpos[:, None],
        time=time[:, None],
        duration=getup.duration * column,
        running=column.astype(bool),
    )


def error(trace, getups, character, style=0) -> float:
    return reference_errors(trace, np.array([style]), getups, character)[0]


def test_the_motion_itself_is_no_way_off_wherever_it_lies(getups, character):
    trace = played(getups[0], lambda x: x, turn_rad=2.0, away_m=3.0)
    assert error(trace, getups, character) < 0.001


def test_another_pace_is_warped(getups, character):
    late = played(getups[0], lambda x: x**1.4)
    early = played(getups[0], lambda x: x**0.75)
    assert max(error(trace, getups, character) for trace in (late, early)) < 0.03


def test_another_motion_is_far(getups, character):
    names = [getup.name for getup in getups]
    bridge = names.index("supine_bridge_half_kneel")
    trace = played(getups[names.index("prone_half_kneel_left")], lambda x: x)
    trace.time = trace.time * getups[bridge].duration / trace.duration
    trace.duration = np.full_like(trace.duration, getups[bridge].duration)
    assert error(trace, getups, character, bridge) > 0.15


def test_it_is_not_known_of_what_ended_early_and_of_curves_alone(getups, character):
    trace = played(getups[0], lambda x: x)
    drawn = next(i for i, getup in enumerate(getups) if getup.clip is None)
    assert np.isnan(error(trace, getups, character, drawn))
    trace.running = trace.running & (trace.time < 1.0)
    assert np.isnan(error(trace, getups, character))
