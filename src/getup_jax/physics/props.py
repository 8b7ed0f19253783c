"""Balls that fly beside the character, and a racket in its hand: additions to its MJCF.

Balls collide with the ground and with rackets alone. They are part of the simulated scene only:
`CharacterSpec.model` stays the character by itself, so that motion and poses do not know them.
"""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np

from getup_jax.config import ConfigError

PROP_BIT = 2  # collision bit of balls; the ground and rackets answer to it
_PARKED_M = (0.0, 0.0, 5.0)  # where balls are until a goal puts them somewhere
_APART_M = 0.3
_WRIST = (("flex", (0, 1, 0), 1.4), ("abd", (-1, 0, 0), 0.8), ("twist", (0, 0, -1), 1.5))
_WRIST_SERVO = (100.0, 10.0, 30.0)  # stiffness (Nm/rad), damping (Nms/rad), torque limit (Nm)
RACKET_CENTRE_M = (0.0, 0.0, -0.42)  # of its head, in the hand's frame: it prolongs the forearm
_HEAD_M = (0.13, 0.01)  # radius, half thickness of what is drawn
# Half thickness of what the ball meets: within a physics step a fast ball must not pass the middle.
_SWEPT_M = 0.1
_HEAD_KG, _HANDLE_KG = 0.2, 0.1
# Stiffness (1/s^2) and damping (1/s) of a ball's bounce: it lasts for about two physics steps, and
# leaves .62 to .83 of the speed up to 16 m/s.
_BOUNCE = (-3e4, -20.0)


@dataclasses.dataclass(frozen=True)
class Ball:
    """A free body that a goal plays with."""

    name: str
    radius_m: float
    mass_kg: float
    rgba: tuple[float, float, float, float] = (0.85, 0.75, 0.2, 1.0)


@dataclasses.dataclass(frozen=True)
class Equipment:
    """What the character plays with."""

    balls: tuple[Ball, ...] = ()
    racket: bool = False  # fixed to the right hand, with a wrist of three hinges


def add_balls(spec: mujoco.MjSpec, balls: tuple[Ball, ...], floor: str) -> None:
    """Free bodies behind the character's own, parked above it."""
    if not balls:
        return
    spec.geom(floor).conaffinity |= PROP_BIT
    for key in list(spec.keys):
        spec.delete(key)  # they are the character's alone, and too short here
    for number, ball in enumerate(balls):
        x, y, z = _PARKED_M
        body = spec.worldbody.add_body(name=ball.name, pos=[x, y, z + number * _APART_M])
        body.add_freejoint(name=ball.name)
        body.add_geom(
            name=ball.name,
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[ball.radius_m, 0, 0],
            mass=ball.mass_kg,
            rgba=ball.rgba,
            contype=PROP_BIT,
            conaffinity=0,
            solref=_BOUNCE,
            priority=1,
        )


def with_balls(
    qpos: np.ndarray, qvel: np.ndarray, scene: mujoco.MjModel
) -> tuple[np.ndarray, np.ndarray]:
    """Poses [P, 7 + J] and rates [P, 6 + J] of a character with its balls, parked and at rest."""
    balls = np.tile(scene.qpos0[qpos.shape[1] :], (len(qpos), 1))
    rest = np.zeros((len(qvel), scene.nv - qvel.shape[1]))
    return np.concatenate([qpos, balls], axis=1), np.concatenate([qvel, rest], axis=1)


def add_racket(spec: mujoco.MjSpec) -> None:
    """A racket on the right hand, and three hinges of the wrist with servos [C 6.1]."""
    hand = spec.body("hand_r")
    if hand is None or hand.joints:
        raise ConfigError(
            "composite.goals: tennis_swing: expected a character whose body 'hand_r' has no "
            "joints of its own, as humanoid28; give that as physics.character"
        )
    for axis, direction, limit in _WRIST:
        hand.add_joint(
            name=f"hand_r_{axis}",
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=direction,
            range=np.degrees([-limit, limit]) if spec.compiler.degree else [-limit, limit],
            limited=mujoco.mjtLimited.mjLIMITED_TRUE,
        )
    radius, half = _HEAD_M
    for name, thickness, mass, alpha, bit in (
        ("racket", half, _HEAD_KG, 1.0, 0),
        ("racket_swept", _SWEPT_M, 0.0, 0.0, PROP_BIT),
    ):
        hand.add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_CYLINDER,
            size=[radius, thickness, 0],
            pos=RACKET_CENTRE_M,
            quat=[np.sqrt(0.5), 0, np.sqrt(0.5), 0],  # its face looks along the palm's x
            mass=mass,
            rgba=[0.2, 0.5, 0.3, alpha],
            contype=0,
            conaffinity=bit,
        )
    hand.add_geom(
        name="racket_handle",
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        fromto=[0, 0, -0.03, 0, 0, RACKET_CENTRE_M[2] + radius],
        size=[0.015, 0, 0],
        mass=_HANDLE_KG,
        contype=0,
        conaffinity=0,
    )
    _add_wrist_servos(spec)
    _add_to_keys(spec, after="forearm_r_flex", count=len(_WRIST))


def _add_wrist_servos(spec: mujoco.MjSpec) -> None:
    """The three servos, and all after them anew, so that their order is that of the hinges."""
    before = [a.name for a in spec.actuators].index("forearm_r_flex") + 1
    later = [_servo_of(actuator) for actuator in spec.actuators[before:]]
    for actuator in list(spec.actuators[before:]):
        spec.delete(actuator)
    wrist = [(f"hand_r_{axis}", *_WRIST_SERVO) for axis, *_ in _WRIST]
    for name, stiffness, damping, torque in [*wrist, *later]:
        actuator = spec.add_actuator(name=name, target=name)
        actuator.trntype = mujoco.mjtTrn.mjTRN_JOINT
        actuator.set_to_position(kp=stiffness, kv=damping)
        actuator.forcerange = [-torque, torque]
        actuator.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE


def _servo_of(actuator: mujoco.MjsActuator) -> tuple[str, float, float, float]:
    gain, bias = float(actuator.gainprm[0]), float(-actuator.biasprm[2])
    return actuator.name, gain, bias, float(actuator.forcerange[1])


def _add_to_keys(spec: mujoco.MjSpec, after: str, count: int) -> None:
    """Zero angles of new hinges behind the hinge `after` in every keyframe."""
    hinges = [j.name for j in spec.joints if j.type == mujoco.mjtJoint.mjJNT_HINGE]
    place = 7 + hinges.index(after) + 1
    for key in spec.keys:
        key.qpos = np.insert(np.asarray(key.qpos), place, np.zeros(count))
