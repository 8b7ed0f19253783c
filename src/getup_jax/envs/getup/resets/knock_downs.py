"""Lying starts of bodies that stood, were pushed and fell [T, conclusion].

A force acts on the head, the chest or the pelvis for a moment, in any horizontal direction, while
the servos hold the standing pose with their full torque or a share of it. Runs on the host.
"""

from __future__ import annotations

import mujoco
import numpy as np
from mujoco.batch import Batch, SimulationError

from getup_jax.envs.getup.resets.lying import (
    Log,
    Place,
    Starts,
    come_to_rest,
    fair_starts,
    falling_model,
    spawn,
    until_enough,
)
from getup_jax.physics.character import CharacterSpec
from getup_jax.physics.surface import TOUCH_M, lift

PUSHED = ("head", "spine_upper", "pelvis")
STRENGTHS = (0.05, 0.2, 1.0)  # shares of the torque limits
_FORCE_N = {"head": (60.0, 180.0), "spine_upper": (150.0, 450.0), "pelvis": (200.0, 600.0)}
_PUSH_S = 0.25
_POSE_NOISE_RAD = 0.1
_LYING_M = 0.4  # the neck of what lies is below this height above the ground


def knock_down(
    character: CharacterSpec,
    place: Place,
    wanted: np.ndarray,
    standing: Starts | None,
    rng: np.random.Generator,
    log: Log,
) -> Starts:
    """Bodies at rest that were pushed over, wanted [R] of them in every region.

    character: with the ground in its model. standing: what stands on irregular ground; in the
    first region, which is flat, the neutral pose does.
    """

    def pushed(region: np.ndarray) -> Starts:
        qpos = _standing_poses(character, place, region, standing, rng)
        strength = rng.choice(STRENGTHS, size=len(qpos))
        link, force = _pushes(len(qpos), rng)
        fallen = np.full_like(qpos, np.nan)
        for share in STRENGTHS:
            own = strength == share
            fallen[own] = _push_over(character, qpos[own], share, link[own], force[own])
        lying = np.nan_to_num(_neck_height(character, place, fallen), nan=np.inf) < _LYING_M
        starts = fair_starts(character, place, fallen[lying], region[lying])
        log(f"lying starts: {len(starts.region)} of {len(region)} bodies were pushed over")
        return starts

    return until_enough(wanted, pushed, "bodies that are pushed do not come to rest")


def _standing_poses(
    character: CharacterSpec,
    place: Place,
    region: np.ndarray,
    standing: Starts | None,
    rng: np.random.Generator,
) -> np.ndarray:
    """Poses [N, 7 + J] with noise on the hinges that stand in the regions [N], with any heading."""
    size = len(region)
    qpos = np.tile(character.neutral_qpos, (size, 1))
    qpos[:, :2] = spawn(place, region, rng)
    half = rng.uniform(-np.pi, np.pi, size) / 2
    qpos[:, 3:7] = np.stack([np.cos(half), *np.zeros((2, size)), np.sin(half)], axis=1)
    for index in np.unique(region[region > 0]):
        own = region == index
        assert standing is not None, "on irregular ground the feet must be turned to the slope"
        qpos[own] = rng.choice(standing.qpos[standing.region == index], size=own.sum())
    noisy = qpos[:, 7:] + _POSE_NOISE_RAD * rng.standard_normal(qpos[:, 7:].shape)
    qpos[:, 7:] = np.clip(noisy, character.joint_lower, character.joint_upper)
    return lift(character, place.field(), qpos, -TOUCH_M)


def _pushes(count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Which of PUSHED are pushed [N], and the horizontal forces [N, 3] (N)."""
    link = rng.integers(len(PUSHED), size=count)
    low, high = np.array([_FORCE_N[name] for name in PUSHED])[link].T
    size, angle = rng.uniform(low, high), rng.uniform(-np.pi, np.pi, count)
    return link, size[:, None] * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)


def _push_over(
    character: CharacterSpec,
    qpos: np.ndarray,
    strength: float,
    link: np.ndarray,
    force: np.ndarray,
) -> np.ndarray:
    """Poses [N, 7 + J] at rest after the forces [N, 3] on the links [N]; NaN where it failed."""
    if not len(qpos):
        return qpos
    model = falling_model(character, strength)
    batch = Batch(model, len(qpos))
    batch.qpos[:], batch.ctrl[:] = qpos, qpos[:, 7:]
    body = np.array([character.link(name) + 1 for name in PUSHED])[link]
    batch.bind("xfrc_applied")[np.arange(len(qpos)), body, :3] = force
    try:
        batch.step(nstep=round(_PUSH_S / model.opt.timestep))
    except SimulationError as error:
        batch.qpos[error.ids] = np.nan
    return come_to_rest(character, batch.qpos, strength, batch.qvel, qpos[:, 7:])


def _neck_height(character: CharacterSpec, place: Place, qpos: np.ndarray) -> np.ndarray:
    """Height [N] (m) of the neck above the ground below it."""
    data, link = mujoco.MjData(character.model), character.link("neck") + 1
    neck = np.empty((len(qpos), 3))
    for index, row in enumerate(qpos):
        data.qpos[:] = row
        mujoco.mj_kinematics(character.model, data)
        neck[index] = data.xpos[link]
    return neck[:, 2] - place.field().height(neck[:, :2])
