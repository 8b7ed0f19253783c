"""The conditional VAE of human poses [P 3.5] and its loss; Z is the latent's size.

Encoder and decoder are tanh perceptrons that both see the condition c = (h, theta_x, theta_z), the
features of the pose. Angles and condition enter in rad and m and are standardised inside, by the
training set's statistics; the decoder's output is scaled back the same way. So the networks see
hinges of all ranges alike, while the loss is the paper's, in rad^2.

A mirrored one is equivariant by construction. M is the mirror image, and S that of the latent:

    encode(q, c) = (f(q, c) + S f(M q, M c)) / 2        decode(z, c) = (g(z, c) + M g(S z, M c)) / 2
"""

from __future__ import annotations

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from flax import linen as nn

from getup_jax.core import mirror
from getup_jax.core.mirror import SignedPermutation
from getup_jax.networks.mlp import OUTPUT_LAYER

CONDITION_SIZE = 3  # height (m), side and front angle (rad)

# In rad and m. A hinge that hardly moves in the data must not be blown up to unit variance.
MIN_STD = 0.02


class TanhNetwork(nn.Module):
    """Dense layers with tanh between them and Glorot's kernels: [..., I] to [..., output_size]."""

    hidden_sizes: tuple[int, ...]
    output_size: int

    @nn.compact
    def __call__(self, x: jax.Array) -> jax.Array:
        """The outputs [..., output_size] for inputs x[..., I]; no tanh after the last layer."""
        init = nn.initializers.glorot_uniform()
        for index, size in enumerate(self.hidden_sizes):
            x = nn.tanh(nn.Dense(size, kernel_init=init, name=f"hidden_{index}")(x))
        return nn.Dense(self.output_size, kernel_init=init, name=OUTPUT_LAYER)(x)


class CVAE(nn.Module):
    """q(z | pose, c) = N(mean, exp(log_variance)) and the decoder (z, c) -> pose.

    `conditional=False` is the standard VAE, for the ablation: the same calls, c is not seen.
    """

    num_joints: int  # J
    latent_size: int  # Z
    hidden_sizes: tuple[int, ...]
    conditional: bool = True
    mirrored: bool = False

    def setup(self) -> None:
        """Both perceptrons, and what travels with the parameters: statistics, mirror image [J]."""
        self.encoder = TanhNetwork(self.hidden_sizes, 2 * self.latent_size)
        self.decoder = TanhNetwork(self.hidden_sizes, self.num_joints)
        self.angle_mean = self.variable("statistics", "angle_mean", jnp.zeros, self.num_joints)
        self.angle_std = self.variable("statistics", "angle_std", jnp.ones, self.num_joints)
        self.condition_mean = self.variable(
            "statistics", "condition_mean", jnp.zeros, CONDITION_SIZE
        )
        self.condition_std = self.variable("statistics", "condition_std", jnp.ones, CONDITION_SIZE)
        if self.mirrored:
            self.mirror_index = self.variable("mirror", "index", jnp.arange, self.num_joints)
            self.mirror_sign = self.variable("mirror", "sign", jnp.ones, self.num_joints)

    def __call__(
        self, angles: jax.Array, condition: jax.Array, noise: jax.Array
    ) -> tuple[jax.Array, jax.Array, jax.Array]:
        """Decoded angles [..., J], mean and log variance [..., Z], for normal noise [..., Z]."""
        mean, log_variance = self.encode(angles, condition)
        latent = mean + jnp.exp(0.5 * log_variance) * noise
        return self.decode(latent, condition), mean, log_variance

    def encode(self, angles: jax.Array, condition: jax.Array) -> tuple[jax.Array, jax.Array]:
        """Mean and log variance [..., Z] of angles [..., J] (rad), condition [..., 3]."""
        if not self.mirrored:
            return self._encode(angles, condition)
        both = self._angle_mirror().stacked(angles), mirror.CURVE.stacked(condition)
        mean, log_variance = self._encode(*both)
        latent = mirror.latent(self.latent_size)
        return latent.averaged(mean), latent.unsigned().averaged(log_variance)

    def _encode(self, angles: jax.Array, condition: jax.Array) -> tuple[jax.Array, jax.Array]:
        standard = (angles - self.angle_mean.value) / self.angle_std.value
        mean, log_variance = jnp.split(self.encoder(self._join(standard, condition)), 2, axis=-1)
        return mean, log_variance

    def decode(self, latent: jax.Array, condition: jax.Array) -> jax.Array:
        """Angles [..., J] (rad) for latents [..., Z] and condition [..., 3]."""
        if not self.mirrored:
            return self._decode(latent, condition)
        both = mirror.latent(self.latent_size).stacked(latent), mirror.CURVE.stacked(condition)
        return self._angle_mirror().averaged(self._decode(*both))

    def _decode(self, latent: jax.Array, condition: jax.Array) -> jax.Array:
        standard = self.decoder(self._join(latent, condition))
        return self.angle_mean.value + self.angle_std.value * standard

    def _angle_mirror(self) -> SignedPermutation:
        return SignedPermutation(self.mirror_index.value, self.mirror_sign.value)

    def _join(self, x: jax.Array, condition: jax.Array) -> jax.Array:
        if not self.conditional:
            return x
        standard = (condition - self.condition_mean.value) / self.condition_std.value
        return jnp.concatenate([x, standard], axis=-1)


def init_variables(
    model: CVAE,
    key: jax.Array,
    angles: jax.Array,
    condition: jax.Array,
    angle_mirror: SignedPermutation | None = None,
) -> dict[str, Any]:
    """Fresh parameters, with the statistics of training angles [N, J] and conditions [N, 3].

    angle_mirror [J]: of a mirrored model; its statistics are of the poses and their images.
    """
    statistics = {
        **_moments("angle", angles, angle_mirror),
        **_moments("condition", condition, mirror.CURVE if model.mirrored else None),
    }
    variables = {**_init(model, key), "statistics": jax.tree.map(jnp.asarray, statistics)}
    if not model.mirrored:
        return variables
    if angle_mirror is None:
        raise ValueError("angle_mirror: expected the hinges' mirror image for a mirrored model")
    images = {"index": angle_mirror.index, "sign": angle_mirror.sign}
    return {**variables, "mirror": jax.tree.map(jnp.asarray, images)}


def _moments(
    name: str, x: jax.Array, image: SignedPermutation | None
) -> dict[str, np.ndarray | jax.Array]:
    """Mean and standard deviation of x[N, I], with those of its images where there are some."""
    mean, std = np.mean(x, axis=0), np.std(x, axis=0)
    if image is not None:
        mean, variance = image.moments(mean, std**2)
        std = np.sqrt(variance)
    return {f"{name}_mean": mean, f"{name}_std": np.maximum(std, MIN_STD)}


@partial(jax.jit, static_argnames="model")
def _init(model: CVAE, key: jax.Array) -> Any:
    sizes = (model.num_joints, CONDITION_SIZE, model.latent_size)
    return model.init(key, *(jnp.zeros(size) for size in sizes))


def kl_to_standard_normal(mean: jax.Array, log_variance: jax.Array) -> jax.Array:
    """KL(N(mean, exp(log_variance)) || N(0, 1)) summed over the last axis, [...] (nats).

    1/2 sum(mean^2 + exp(log_variance) - log_variance - 1)
    """
    terms = jnp.square(mean) + jnp.exp(log_variance) - log_variance - 1.0
    return 0.5 * jnp.sum(terms, axis=-1)


def loss_terms(
    model: CVAE,
    variables: dict[str, Any],
    batch: tuple[jax.Array, jax.Array],
    noise: jax.Array,
    beta: jax.Array | float,
    blur: jax.Array | float = 0.0,
) -> dict[str, jax.Array]:
    """The terms of the loss [] of a batch (angles [N, J], condition [N, 3]); it is their sum.

    reconstruction: the squared error, averaged over batch and hinges (rad^2).
    kl: beta times the divergence from N(0, 1), *summed* over batch and latent. This is the
    reduction of the published ancestor (Yin et al. 2021), so beta goes with the batch size: per
    pose, the KL weighs N * beta against the mean squared error.

    noise [N, Z] is standard normal. blur [N, J] (rad) is added to what the encoder sees, and not
    to what is to be decoded.
    """
    angles, condition = batch
    output: Any = model.apply(variables, angles + blur, condition, noise)
    decoded, mean, log_variance = output
    return {
        "reconstruction": jnp.mean(jnp.square(decoded - angles)),
        "kl": beta * jnp.sum(kl_to_standard_normal(mean, log_variance)),
    }
