"""A get-up environment that is made in a moment, for the tests of the ways to it."""

from __future__ import annotations

import numpy as np

import getup_jax as gj
from getup_jax.config import Config


def small() -> Config:
    """configs/quick.yaml with few start states, from which episodes soon end when acted at random.

    Random servo targets make a standing body fall within a second.
    """
    return gj.load_config("quick", "task.pool_size=16")


def noise(shape: tuple[int, ...], seed: int = 0) -> np.ndarray:
    """Actions, each of standard deviation 1."""
    return np.random.default_rng(seed).normal(size=shape).astype(np.float32)
