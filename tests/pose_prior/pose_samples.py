"""Synthetic poses with a known number of degrees of freedom, and a prior trained on them."""

from __future__ import annotations

import functools

import numpy as np

from getup_jax.config import PhysicsConfig, PriorConfig
from getup_jax.physics.character import CharacterSpec, load_character
from getup_jax.pose_prior.data import PoseSet, make_pose_set
from getup_jax.pose_prior.prior import PosePrior
from getup_jax.pose_prior.training import PriorReport, train_prior

# A small network with a high learning rate reaches in seconds what the defaults reach in minutes.
QUICK = PriorConfig(
    latent_size=4, hidden_sizes=(64, 64), learning_rate=3e-3, epochs=1, min_updates=1500
)


@functools.cache
def character() -> CharacterSpec:
    return load_character(PhysicsConfig())


def manifold_poses(count: int = 1500) -> np.ndarray:
    """Poses [count, 7 + J] on a curved 2-D manifold, smooth in time, inside the joint limits."""
    spec = character()
    time = np.arange(count) / 30.0
    phase = np.stack([0.9 * time, 0.37 * time + 1.0], axis=1)
    weights = np.random.default_rng(1).normal(size=(2, spec.num_joints)) * 0.7
    wave = np.tanh(np.sin(phase) @ weights)
    middle = 0.5 * (spec.joint_lower + spec.joint_upper)
    poses = np.tile(spec.neutral_qpos, (count, 1))
    poses[:, 7:] = middle + 0.35 * (spec.joint_upper - spec.joint_lower) * wave
    poses[:, 2] = 0.6 + 0.3 * np.sin(phase[:, 0])
    lean = 0.8 * np.sin(phase[:, 1])  # about the lateral axis
    poses[:, 3], poses[:, 5] = np.cos(lean / 2), np.sin(lean / 2)
    return poses


@functools.cache
def pose_set() -> PoseSet:
    return make_pose_set(manifold_poses(), character())


@functools.cache
def quick_prior() -> tuple[PosePrior, PriorReport]:
    return train_prior(pose_set(), QUICK)
