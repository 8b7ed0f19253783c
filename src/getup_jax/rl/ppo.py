"""PPO-Clip for K objectives: the loss as named terms, and what to watch.

Pure functions of arrays: N samples, actions of size A, K objectives. With K = 1 and weight 1 they
are plain PPO (Schulman et al. 2017).
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from flax import struct

from getup_jax.core import device_axis
from getup_jax.networks import gaussian


@struct.dataclass
class Samples:
    """What an update learns from: N samples, in any order."""

    observation: jax.Array  # [N, O] normalised
    action: jax.Array  # [N, A]
    log_prob: jax.Array  # [N] of the action, by the policy that took it
    advantage: jax.Array  # [N, K] standardised
    target: jax.Array  # [N, K] in the critic's units


@struct.dataclass
class ActorTerms:
    """The terms of the actor's loss before their coefficients, float32 scalars."""

    policy: jax.Array
    entropy: jax.Array  # nats; the loss falls as it grows


def actor_terms(
    mean: jax.Array, samples: Samples, std: jax.Array, weights: jax.Array, clip: float
) -> tuple[ActorTerms, dict[str, jax.Array]]:
    """The terms on some samples, and what to log of them.

    Args:
        mean: [N, A], the actor's on the samples' observations.
        samples: what the old policy did.
        std: [A] of the old and the new policy, or [N, A] of the new one for each sample.
        weights: [K] of the objectives, their sum is 1.
        clip: half-width of the range of ratios.
    """
    log_ratio = gaussian.log_prob(samples.action, mean, std) - samples.log_prob
    ratio = jnp.exp(log_ratio)
    terms = ActorTerms(
        policy=policy_loss(ratio, samples.advantage, weights, clip),
        # Constant where the std is a setting: the term then moves the loss, not its gradient.
        entropy=jnp.mean(gaussian.entropy(std)),
    )
    metrics = {
        "loss/policy": terms.policy,
        "ppo/clip_fraction": clip_fraction(ratio, clip),
        "ppo/kl": approx_kl(log_ratio),
    }
    return terms, metrics


def actor_loss(terms: ActorTerms, entropy_coefficient: float) -> jax.Array:
    """policy - entropy_coefficient * entropy."""
    return terms.policy - entropy_coefficient * terms.entropy


def policy_loss(
    ratio: jax.Array, advantage: jax.Array, weights: jax.Array, clip: float
) -> jax.Array:
    """The clipped surrogate, clipped for each objective and only then summed over them.

        -mean_n sum_k w_k min(ratio_n A_nk, clip(ratio_n, 1 - clip, 1 + clip) A_nk)

    Schulman et al. 2017, equation 7, with the weights of Xu et al. 2023, equation 7. Clipping the
    summed advantage would be another objective: one objective's gain could keep the ratio moving
    where another's is already clipped.

    Args:
        ratio: [N], new over old probability of the action.
        advantage: [N, K], standardised for each objective.
        weights: [K], their sum is 1.
        clip: half-width of the range of ratios.
    """
    ratio = ratio[:, None]
    clipped = jnp.clip(ratio, 1.0 - clip, 1.0 + clip)
    surrogate = jnp.minimum(ratio * advantage, clipped * advantage)
    return -jnp.mean(jnp.sum(weights * surrogate, axis=-1))


def value_loss(output: jax.Array, target: jax.Array) -> jax.Array:
    """Mean squared error over samples and objectives, [N, K] both; without value clipping.

    It has an optimiser of its own, and Adam does not see a loss's scale, so the papers' coefficient
    of it has nothing to say here.
    """
    return jnp.mean(jnp.square(output - target))


def standardize(advantage: jax.Array) -> jax.Array:
    """Every objective's advantages [..., K] to mean 0 and std 1 (Xu et al. 2023, equation 8)."""
    axes = tuple(range(advantage.ndim - 1))
    centred = advantage - device_axis.mean(advantage, axes)
    return centred / (device_axis.std(advantage, axes) + 1e-8)


def clip_fraction(ratio: jax.Array, clip: float) -> jax.Array:
    """Share of the ratios [N] that lie outside 1 +- clip."""
    return jnp.mean((jnp.abs(ratio - 1.0) > clip).astype(jnp.float32))


def approx_kl(log_ratio: jax.Array) -> jax.Array:
    """KL(old || new) from samples of old, mean of (ratio - 1) - log ratio (nats).

    The estimator k3 of Schulman, "Approximating KL divergence" (2020): unbiased, never negative.
    """
    return jnp.mean(jnp.expm1(log_ratio) - log_ratio)


def explained_variance(value: jax.Array, target: jax.Array) -> jax.Array:
    """1 - var(target - value) / var(target), mean over K objectives, of [..., K].

    1: the critic foresees every target; 0: no better than a constant; NaN: the targets are one.
    """
    axes = tuple(range(target.ndim - 1))
    total = device_axis.var(target, axes)
    share = 1.0 - device_axis.var(target - value, axes) / jnp.where(total > 0, total, jnp.nan)
    return jnp.mean(share)
