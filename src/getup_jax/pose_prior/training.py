"""Training of the pose prior: every epoch is one jitted scan over shuffled minibatches."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import optax
from flax import struct

from getup_jax.config import PriorConfig
from getup_jax.core import mirror
from getup_jax.pose_prior import prior as pose_prior
from getup_jax.pose_prior.cvae import CVAE, init_variables, kl_to_standard_normal, loss_terms
from getup_jax.pose_prior.data import PoseSet, split
from getup_jax.pose_prior.prior import MIN_LATENT_STD, PosePrior

# epoch (from 1), epochs, mean of every loss term over the epoch
Progress = Callable[[int, int, dict[str, float]], None]

PROGRESS_CALLS = 20  # of one training
NUM_RANDOM_POSES = 4096

# rad. Poses at a limit are decoded with an error of this size, which says nothing about the prior.
LIMIT_TOLERANCE = 0.05


@dataclasses.dataclass(frozen=True)
class PriorReport:
    """What is known of a prior after training; errors are of the decoded latent mean."""

    num_poses: int  # trained on
    num_heldout: int
    epochs: int
    updates: int
    seconds: float  # wall time of the training, compilation included
    train_rmse_deg: float  # root mean square over poses and hinges
    heldout_rmse_deg: float
    mean_kl: float  # nats per held-out pose, summed over the latent
    active_latents: int  # dimensions whose standard deviation is above the floor
    pca_variance: float  # share of the training variance in the first latent_size components
    random_angles_outside: float  # share of hinge angles past a limit, decoded random latents
    random_poses_outside: float  # share of those poses with any hinge past a limit
    random_worst_deg: float  # furthest past a limit


@struct.dataclass
class Recipe:
    """How to train: what an epoch needs beside state and data."""

    model: CVAE = struct.field(pytree_node=False)
    batch_size: int = struct.field(pytree_node=False)
    updates: jax.Array  # [] of the whole training
    learning_rate: jax.Array  # []
    last_rate: jax.Array  # [] share of the learning rate at the end
    weight_decay: jax.Array  # []
    input_noise: jax.Array  # [] standard deviations of each hinge
    beta: jax.Array  # []

    @property
    def optimiser(self) -> optax.GradientTransformation:
        """AdamW with a rate that falls along half a cosine; Adam at a constant one by default."""
        return optax.adamw(self.rate, weight_decay=self.weight_decay)

    def rate(self, count: Any) -> jax.Array:
        """Learning rate [] of update number `count`."""
        fallen = 0.5 - 0.5 * jnp.cos(jnp.pi * count / self.updates)
        return self.learning_rate * (1.0 - (1.0 - self.last_rate) * fallen)


@struct.dataclass
class FitState:
    """What one epoch hands to the next."""

    variables: dict[str, Any]  # of the CVAE; its statistics never change
    moments: Any  # optax state
    key: jax.Array  # never changes: epochs fold their number into it


def train_prior(
    poses: PoseSet, config: PriorConfig, progress: Progress | None = None
) -> tuple[PosePrior, PriorReport]:
    """A prior trained on all of `poses` but the held-out groups, and how good it is.

    The defaults are Adam with a constant learning rate [P 3.5]. It runs for `epochs` or until
    `min_updates` updates, whichever takes longer. A device computes the same prior from the same
    arguments.
    """
    start = time.perf_counter()
    rows = split(poses.group, config.holdout, config.seed)
    train, heldout = (_arrays(poses, part) for part in rows)
    num_joints = poses.angles.shape[1]
    mirrored = config.mirror and poses.mirror is not None
    model = CVAE(num_joints, config.latent_size, config.hidden_sizes, config.conditional, mirrored)
    key_init, key_epochs = jax.random.split(jax.random.key(config.seed))
    image = poses.mirror if mirrored else None
    fresh = FitState(init_variables(model, key_init, *train, image), None, key_epochs)
    variables, epochs, updates = _fit(model, fresh, train, config, progress)
    latent_mean, latent_std = _latent_scale(model, variables, *train)
    prior = PosePrior(
        variables=variables,
        latent_mean=latent_mean,
        latent_std=latent_std,
        joint_lower=jnp.asarray(poses.joint_lower),
        joint_upper=jnp.asarray(poses.joint_upper),
    )
    seconds = time.perf_counter() - start
    rng = np.random.default_rng(config.seed)
    random = random_poses(prior, poses.condition, NUM_RANDOM_POSES, rng)
    report = PriorReport(
        num_poses=len(train[0]),
        num_heldout=len(heldout[0]),
        epochs=epochs,
        updates=updates,
        seconds=seconds,
        train_rmse_deg=rmse_deg(prior, *train),
        heldout_rmse_deg=rmse_deg(prior, *heldout),
        mean_kl=float(_mean_kl(prior, *heldout)),
        active_latents=int(jnp.sum(latent_std > MIN_LATENT_STD)),
        pca_variance=pca_variance(np.asarray(train[0]), config.latent_size),
        **limit_check(prior, random),
    )
    return prior, report


def random_poses(
    prior: PosePrior, condition: np.ndarray, count: int, rng: np.random.Generator
) -> jax.Array:
    """Joint angles [count, J] of random latents under rows of condition [N, 3] drawn at random."""
    rows = condition[rng.integers(len(condition), size=count)]
    return decode_random(prior, rows, rng)


def decode_random(prior: PosePrior, condition: np.ndarray, rng: np.random.Generator) -> jax.Array:
    """Joint angles [N, J] of latents drawn from N(latent_mean, latent_std) under [N, 3]."""
    action = rng.standard_normal((len(condition), prior.latent_size), np.float32)
    return jax.jit(pose_prior.decode_action)(prior, jnp.asarray(action), jnp.asarray(condition))


def limit_check(prior: PosePrior, angles: jax.Array) -> dict[str, float]:
    """How far angles [N, J] (rad) leave the joint limits; see the fields of PriorReport."""
    excess = np.maximum(prior.joint_lower - angles, angles - prior.joint_upper)
    outside = excess > LIMIT_TOLERANCE
    return {
        "random_angles_outside": float(outside.mean()),
        "random_poses_outside": float(outside.any(axis=-1).mean()),
        "random_worst_deg": math.degrees(max(0.0, float(excess.max()))),
    }


def rmse_deg(prior: PosePrior, angles: jax.Array, condition: jax.Array) -> float:
    """Root mean square error of the reconstruction over poses [N] and hinges [J], in degrees."""
    return math.degrees(math.sqrt(_square_error(prior, angles, condition)))


def pca_variance(angles: np.ndarray, components: int) -> float:
    """Share of the variance of angles [N, J] that the first principal components cover."""
    eigenvalues = np.linalg.eigvalsh(np.cov(angles, rowvar=False))[::-1]
    return float(eigenvalues[:components].sum() / eigenvalues.sum())


@partial(jax.jit, static_argnames="model")
def _latent_scale(
    model: CVAE, variables: Any, angles: jax.Array, condition: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """Mean and standard deviation [Z] of the encoded poses, the latter floored.

    Of a mirrored prior, those of the poses and their images.
    """
    encoded: Any = model.apply(variables, angles, condition, method="encode")
    mean, variance = jnp.mean(encoded[0], axis=0), jnp.var(encoded[0], axis=0)
    if model.mirrored:
        mean, variance = mirror.latent(model.latent_size).moments(mean, variance)
    return mean, jnp.maximum(jnp.sqrt(variance), MIN_LATENT_STD)


@jax.jit
def _square_error(prior: PosePrior, angles: jax.Array, condition: jax.Array) -> jax.Array:
    decoded = pose_prior.decode(prior, pose_prior.encode(prior, angles, condition), condition)
    return jnp.mean(jnp.square(decoded - angles))


@jax.jit
def _mean_kl(prior: PosePrior, angles: jax.Array, condition: jax.Array) -> jax.Array:
    return jnp.mean(kl_to_standard_normal(*pose_prior.posterior(prior, angles, condition)))


def _arrays(poses: PoseSet, rows: np.ndarray) -> tuple[jax.Array, jax.Array]:
    return jnp.asarray(poses.angles[rows]), jnp.asarray(poses.condition[rows])


def _fit(
    model: CVAE,
    state: FitState,
    data: tuple[jax.Array, jax.Array],
    config: PriorConfig,
    progress: Progress | None,
) -> tuple[dict[str, Any], int, int]:
    """Trained variables, the number of epochs and of updates; `state` has no moments yet."""
    size = min(config.batch_size, len(data[0]))
    updates = len(data[0]) // size
    epochs = max(config.epochs, math.ceil(config.min_updates / updates))
    names = ("learning_rate", "last_rate", "weight_decay", "input_noise", "beta")
    values = {name: jnp.float32(getattr(config, name)) for name in names}
    recipe = Recipe(model, size, jnp.float32(epochs * updates), **values)
    state = state.replace(moments=recipe.optimiser.init(state.variables["params"]))
    every = math.ceil(epochs / PROGRESS_CALLS)
    for epoch in range(1, epochs + 1):
        state, terms = _epoch(recipe, state, data, epoch)
        if progress is not None and (epoch % every == 0 or epoch == epochs):
            progress(epoch, epochs, {name: float(value) for name, value in terms.items()})
    return state.variables, epochs, epochs * updates


@jax.jit
def _epoch(
    recipe: Recipe, state: FitState, data: tuple[jax.Array, jax.Array], number: jax.Array
) -> tuple[FitState, dict[str, jax.Array]]:
    """One pass over shuffled minibatches, and the mean of every loss term."""
    key_order, key_noise = jax.random.split(jax.random.fold_in(state.key, number))
    # Rows past the last whole batch wait for another epoch's order.
    count = len(data[0]) // recipe.batch_size
    order = jax.random.permutation(key_order, len(data[0]))[: count * recipe.batch_size]
    order = order.reshape(count, recipe.batch_size)
    batches = jax.tree.map(lambda x: x[order], data)
    noise = jax.random.normal(key_noise, (*order.shape, recipe.model.latent_size))
    keys_blur = jax.random.split(jax.random.fold_in(key_noise, 0), count)

    def update(state: FitState, inputs: tuple[Any, jax.Array, jax.Array]):
        return _update(recipe, state, *inputs)

    state, terms = jax.lax.scan(update, state, (batches, noise, keys_blur))
    return state, jax.tree.map(jnp.mean, terms)


def _update(
    recipe: Recipe,
    state: FitState,
    batch: tuple[jax.Array, jax.Array],
    noise: jax.Array,
    key_blur: jax.Array,
) -> tuple[FitState, dict[str, jax.Array]]:
    """One step of the optimiser on one minibatch, and its loss terms."""
    deviation = recipe.input_noise * state.variables["statistics"]["angle_std"]
    blur = deviation * jax.random.normal(key_blur, batch[0].shape)

    def loss(params: Any):
        variables = {**state.variables, "params": params}
        terms = loss_terms(recipe.model, variables, batch, noise, recipe.beta, blur)
        return sum(terms.values()), terms

    params = state.variables["params"]
    gradient, terms = jax.grad(loss, has_aux=True)(params)
    change, moments = recipe.optimiser.update(gradient, state.moments, params)
    variables = {**state.variables, "params": optax.apply_updates(params, change)}
    return FitState(variables, moments, state.key), terms
