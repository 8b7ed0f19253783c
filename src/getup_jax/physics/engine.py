"""The choice of engine."""

from __future__ import annotations

import jax

from getup_jax.config import PhysicsConfig
from getup_jax.physics.character import CharacterSpec
from getup_jax.types import Engine


def make_engine(character: CharacterSpec, config: PhysicsConfig) -> Engine:
    """The engine that the config names; auto: native on a CPU, mjx on a GPU or TPU."""
    name = config.engine
    if name == "auto":
        name = "native" if jax.default_backend() == "cpu" else "mjx"
    # imported here, since either takes a second that the other does not need
    if name == "native":
        from getup_jax.physics.native import NativeEngine

        return NativeEngine(character, config)
    from getup_jax.physics.mjx import MjxEngine

    return MjxEngine(character, config, impl="warp" if name == "mjx-warp" else "jax")
