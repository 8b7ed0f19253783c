"""One formula for arrays on the host and inside compiled programs."""

from __future__ import annotations

from types import ModuleType

import jax
import jax.numpy as jnp
import numpy as np

Array = jax.Array | np.ndarray


def array_module(*arrays: object) -> ModuleType:
    """jax.numpy where one of the arrays is JAX's (traced ones are, too), else NumPy.

    JAX compiles a program for every operation and shape that it meets outside of jit, which made
    most of the time in which a task was built.
    """
    return jnp if any(isinstance(array, jax.Array) for array in arrays) else np
