"""A get-up task that is made in a moment: hand-made styles, an untrained pose prior."""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from scipy.spatial.transform import Rotation

from getup_jax.config import Config, CurriculumConfig, PhysicsConfig, TaskConfig
from getup_jax.envs.getup.build import BuiltTask, assemble
from getup_jax.motion.clips import Clip, GetUp
from getup_jax.motion.getup.curves import NUM_POINTS
from getup_jax.networks.mlp import OUTPUT_LAYER
from getup_jax.physics.character import CharacterSpec
from getup_jax.physics.mirror_image import joint_mirror
from getup_jax.pose_prior.cvae import CVAE, init_variables
from getup_jax.pose_prior.data import pose_conditions
from getup_jax.pose_prior.prior import PosePrior

LATENT = 16
CLIP_SECONDS = 1.0
CONFIG = Config(
    physics=PhysicsConfig(engine="native"),
    task=TaskConfig(stand_start=0.3, pool_size=24, settle_s=0.2),
    curriculum=CurriculumConfig(reference_start=0.2),
)


def changed(config: Config = CONFIG, **settings: Any) -> Config:
    """The config with other settings of its task and its curriculum, by their names alone."""
    names = {field.name for field in dataclasses.fields(TaskConfig)}
    task = {name: value for name, value in settings.items() if name in names}
    aids = {name: value for name, value in settings.items() if name not in task}
    return dataclasses.replace(
        config,
        task=dataclasses.replace(config.task, **task),
        curriculum=dataclasses.replace(config.training_aids, **aids),
    )


def supine(character: CharacterSpec) -> np.ndarray:
    """The neutral pose [7 + J] on its back, head along -x."""
    pose = character.neutral_qpos.copy()
    pose[:3] = 0.0, 0.0, 0.12
    pose[3:7] = Rotation.from_rotvec([0.0, -np.pi / 2, 0.0]).as_quat(scalar_first=True)
    return pose


def getups(character: CharacterSpec) -> list[GetUp]:
    """One style with a clip of three frames, and one that is a curve alone."""
    sitting = character.neutral_qpos.copy()
    sitting[2] = 0.5
    sitting[3:7] = Rotation.from_rotvec([0.0, -np.pi / 4, 0.0]).as_quat(scalar_first=True)
    qpos = np.stack([supine(character), sitting, character.neutral_qpos])
    clip = Clip("tip up", fps=2 / CLIP_SECONDS, qpos=qpos)
    ends = pose_conditions(qpos[[0, -1]], character)
    points = np.linspace(ends[0], ends[1], NUM_POINTS)
    return [
        GetUp("clip", duration=CLIP_SECONDS, points=points, clip=clip),
        GetUp("curve", duration=2 * CLIP_SECONDS, points=points, clip=None),
    ]


def untrained_prior(character: CharacterSpec, seed: int = 0, mirrored: bool = False) -> PosePrior:
    """A pose prior with random weights."""
    model = CVAE(character.num_joints, LATENT, hidden_sizes=(32,), mirrored=mirrored)
    rng = np.random.default_rng(seed)
    angles = character.neutral_qpos[7:] + 0.1 * rng.normal(size=(64, 49))
    variables = init_variables(
        model,
        jax.random.PRNGKey(seed),
        jnp.asarray(angles, jnp.float32),
        jnp.asarray(rng.normal(size=(64, 3)), jnp.float32),
        joint_mirror(character) if mirrored else None,
    )
    latent_mean = rng.normal(size=LATENT)
    if mirrored:
        latent_mean[LATENT // 2 :] = 0.0
    return PosePrior(
        variables=variables,
        latent_mean=jnp.asarray(latent_mean, jnp.float32),
        latent_std=jnp.asarray(rng.uniform(0.5, 2.0, LATENT), jnp.float32),
        joint_lower=jnp.asarray(character.joint_lower, jnp.float32),
        joint_upper=jnp.asarray(character.joint_upper, jnp.float32),
    )


def neutral_prior(character: CharacterSpec) -> PosePrior:
    """A pose prior that decodes every latent to the neutral pose."""
    prior = untrained_prior(character)
    params, statistics = prior.variables["params"], prior.variables["statistics"]
    output = jax.tree.map(jnp.zeros_like, params["decoder"][OUTPUT_LAYER])
    neutral = jnp.asarray(character.neutral_qpos[7:], jnp.float32)
    return prior.replace(
        variables={
            "params": {**params, "decoder": {**params["decoder"], OUTPUT_LAYER: output}},
            "statistics": {**statistics, "angle_mean": neutral},
        }
    )


def tiny_task(character: CharacterSpec, config: Config = CONFIG) -> BuiltTask:
    log: list[str] = []
    return assemble(config, character, getups(character), neutral_prior(character), log.append)
