"""Functions that are compiled once for all tests of a process."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import jax
import numpy as np


@functools.lru_cache(maxsize=64)
def compiled(function: Callable[..., Any], **options: Any) -> Callable[..., Any]:
    """`jax.jit(function, **options)`, the same one whenever the same method of an object is asked.

    It compiles once for a shape: what tests put together has weak types and devices that the same
    arrays of a simulation have not, and each is another program.
    """
    jitted = jax.jit(function, **options)
    return lambda *args: jitted(*jax.tree.map(_plain, args))


def _plain(x: Any) -> Any:
    if isinstance(x, jax.Array) and not jax.dtypes.issubdtype(x.dtype, jax.dtypes.prng_key):
        return np.asarray(x)
    return x
