"""A composite task that is made in a moment: sines as clips, small networks."""

from __future__ import annotations

import numpy as np

from getup_jax.config import (
    CompositeConfig,
    Config,
    DiscriminatorConfig,
    GroupConfig,
    NetworkConfig,
    PhysicsConfig,
    PPOConfig,
    TaskConfig,
)
from getup_jax.envs.composite.build import BuiltComposite, assemble_composite
from getup_jax.motion.clips import Clip
from getup_jax.physics.character import CharacterSpec

GROUPS = {
    "upper": GroupConfig(links=("upper",), frame="root", speed=(0.8, 1.2)),
    "lower": GroupConfig(links=("lower",)),
}
COMPOSITE = CompositeConfig(
    groups=GROUPS,
    discriminator=DiscriminatorConfig(
        gru_size=8, hidden_sizes=(8,), heads=4, minibatch_size=16, learning_rate=1e-3
    ),
)
CONFIG = Config(
    physics=PhysicsConfig(
        engine="native",
        character="humanoid28",
        substeps=4,
        gain_scale=1.0,
        armature=0.02,
        damping=0.0,
    ),
    task=TaskConfig(pool_size=32),
    composite=COMPOSITE,
    network=NetworkConfig(hidden_sizes=(16,), activation="relu6", gru_size=8, initial_std=0.05),
    ppo=PPOConfig(num_envs=8, num_steps=4, epochs=2, minibatch_size=16, popart=True),
)


def wave(character: CharacterSpec, seconds: float = 1.5, fps: float = 30.0) -> Clip:
    """The right arm up, its forearm to and fro."""
    qpos, phase = _standing(character, seconds, fps)
    qpos[:, 7 + character.joint("arm_r_abd")] = 2.0
    qpos[:, 7 + character.joint("forearm_r_flex")] = -0.8 + 0.5 * np.sin(phase)
    return Clip("wave", fps, qpos)


def squat(character: CharacterSpec, seconds: float = 2.0, fps: float = 30.0) -> Clip:
    """Knees and hips bend and stretch again; the feet stay flat on the floor."""
    qpos, phase = _standing(character, seconds, fps)
    knee = 0.5 * (1.0 - np.cos(phase))
    for side in "lr":
        qpos[:, 7 + character.joint(f"thigh_{side}_flex")] += 0.5 * knee
        qpos[:, 7 + character.joint(f"shin_{side}_flex")] -= knee
        qpos[:, 7 + character.joint(f"foot_{side}_flex")] += 0.5 * knee
    qpos[:, 2] -= (0.4215 + 0.4099) * (1.0 - np.cos(0.5 * knee))
    return Clip("squat", fps, qpos)


def clips(character: CharacterSpec) -> dict[str, list[Clip]]:
    return {"upper": [wave(character)], "lower": [squat(character)]}


def tiny_composite(character: CharacterSpec, config: Config = CONFIG) -> BuiltComposite:
    log: list[str] = []
    return assemble_composite(config, character, clips(character), log.append)


def _standing(character: CharacterSpec, seconds: float, fps: float):
    count = round(seconds * fps) + 1
    phase = 2 * np.pi * np.arange(count) / (count - 1)
    return np.tile(character.neutral_qpos, (count, 1)), phase
