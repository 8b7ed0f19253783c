"""What a pose prior does to bodies: reconstruction, features kept, self-penetration."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from getup_jax.physics.character import CharacterSpec
from getup_jax.pose_prior import prior as pose_prior
from getup_jax.pose_prior.data import pose_conditions
from getup_jax.pose_prior.prior import PosePrior
from getup_jax.pose_prior.training import decode_random, limit_check, rmse_deg

DEEP_M = 0.02  # a penetration of more than this counts
_HIGH_M = 100.0  # a root so high that nothing touches the ground


@dataclasses.dataclass(frozen=True)
class FeatureError:
    """Root mean square errors of the features of decoded poses."""

    height_m: float
    side_angle_rad: float
    front_angle_rad: float


@dataclasses.dataclass(frozen=True)
class Penetration:
    """How deep parts of the body that may collide lie in each other."""

    worst_m: float
    share_deep: float  # of the poses, those with any contact deeper than DEEP_M


@dataclasses.dataclass(frozen=True)
class PriorEvaluation:
    """A prior on given poses, best ones that it was not trained on."""

    num_poses: int
    rmse_deg: float  # of the joint angles of decoded encodings
    feature_error: FeatureError  # of decoded encodings
    random_feature_error: FeatureError  # of decoded random latents under the pose's features
    random_angles_outside: float  # share of hinge angles past a limit, decoded random latents
    random_poses_outside: float  # share of those poses with any hinge past a limit
    random_worst_deg: float  # furthest past a limit
    data_penetration: Penetration  # of the given poses themselves, to compare with
    decoded_penetration: Penetration
    random_penetration: Penetration


def evaluate_prior(
    prior: PosePrior, poses: np.ndarray, character: CharacterSpec, seed: int = 0
) -> PriorEvaluation:
    """Measure a prior on poses [N, 7 + J]; as many random latents are decoded.

    A decoded pose has no root, while the features depend on one. So the decoded joints are put on
    the root of the pose that the condition came from, and the features of the result are compared
    with that condition. Height and front angle then measure how well the spine fits it; the side
    angle is the root's alone where the hips sit on it, and its error is then 0.
    """
    condition = pose_conditions(poses, character)
    angles, c = jnp.asarray(poses[:, 7:], jnp.float32), jnp.asarray(condition)
    decode, encode = jax.jit(pose_prior.decode), jax.jit(pose_prior.encode)
    decoded = decode(prior, encode(prior, angles, c), c)
    random = decode_random(prior, condition, np.random.default_rng(seed))
    return PriorEvaluation(
        num_poses=len(poses),
        rmse_deg=rmse_deg(prior, angles, c),
        feature_error=feature_error(poses, decoded, condition, character),
        random_feature_error=feature_error(poses, random, condition, character),
        **limit_check(prior, random),
        data_penetration=self_penetration(angles, character),
        decoded_penetration=self_penetration(decoded, character),
        random_penetration=self_penetration(random, character),
    )


def feature_error(
    poses: np.ndarray, angles: jax.Array, condition: np.ndarray, character: CharacterSpec
) -> FeatureError:
    """Features of hinge angles [N, J] on the roots of `poses` [N, 7 + J] against [N, 3]."""
    rooted = np.concatenate([poses[:, :7], np.asarray(angles)], axis=1)
    error = pose_conditions(rooted, character) - condition
    return FeatureError(*(float(e) for e in np.sqrt(np.mean(np.square(error), axis=0))))


def self_penetration(angles: jax.Array | np.ndarray, character: CharacterSpec) -> Penetration:
    """Depth of the contacts between parts of one body, for hinge angles [N, J] (rad).

    MuJoCo's own collision pairs: geoms of neighbouring links and excluded pairs are left out.
    """
    depth = np.array([_depth(data, character) for data in _placed(np.asarray(angles), character)])
    return Penetration(worst_m=float(depth.max()), share_deep=float(np.mean(depth > DEEP_M)))


def _placed(angles: np.ndarray, character: CharacterSpec) -> Iterator[mujoco.MjData]:
    """The same data again and again, with one pose after the other far above the ground."""
    data = mujoco.MjData(character.model)
    data.qpos[:] = character.neutral_qpos
    data.qpos[2] = _HIGH_M
    for row in angles:
        data.qpos[7:] = row
        mujoco.mj_kinematics(character.model, data)
        yield data


def _depth(data: mujoco.MjData, character: CharacterSpec) -> float:
    """Deepest contact (m), 0 without any."""
    mujoco.mj_collision(character.model, data)
    return max(0.0, -float(data.contact.dist.min(initial=0.0)))
