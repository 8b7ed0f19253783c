"""Functions that are compiled once for all tests of a process."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from getup_jax.rl.learner import Learner
from getup_jax.rl.state import PolicyState


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


_POLICIES: dict[Any, Any] = {}


def first_policy(learner: Learner, seed: int = 0) -> PolicyState:
    """The policy that a learner without mirror images begins with, made once for equal networks."""
    if learner.model.symmetry is not None:
        return jax.jit(learner.init_learner)(jax.random.PRNGKey(seed)).policy
    env = learner.env
    sizes = env.observation_size, env.action_size, env.num_objectives
    key = repr((learner.model, learner.config, sizes, seed))
    if key not in _POLICIES:
        made = jax.jit(learner.init_learner)(jax.random.PRNGKey(seed)).policy
        _POLICIES[key] = jax.device_get(made)
    return jax.tree.map(jnp.asarray, _POLICIES[key])
