"""The simulated model as one MJCF file, with the config's physics settings in it."""

from __future__ import annotations

import mujoco

from getup_jax.config import PhysicsConfig
from getup_jax.physics.character import SOLVERS, read_spec


def character_xml(config: PhysicsConfig) -> str:
    """MJCF that compiles to the model of `load_character`, on its floor; for MuJoCo alone."""
    spec = read_spec(config.character)
    spec.option.timestep = 1.0 / (config.control_hz * config.substeps)
    spec.option.solver = SOLVERS[config.solver]
    spec.option.iterations = config.iterations
    for joint in spec.joints:
        if joint.type != mujoco.mjtJoint.mjJNT_FREE:
            joint.armature = config.armature
            joint.damping[:] = (config.damping, *joint.damping[1:])
    for actuator in spec.actuators:
        actuator.gainprm[0] *= config.gain_scale
        actuator.biasprm[1:3] *= config.gain_scale
        actuator.forcerange = actuator.forcerange * config.torque_scale
    spec.compile()
    return spec.to_xml()
