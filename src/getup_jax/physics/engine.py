"""The choice of engine."""

from __future__ import annotations

import importlib.util

import jax

from getup_jax.config import PhysicsConfig
from getup_jax.core.types import Engine
from getup_jax.physics.character import CharacterSpec


def make_engine(character: CharacterSpec, config: PhysicsConfig) -> Engine:
    """The engine that the config names; auto: the fastest one here."""
    name = _fastest() if config.engine == "auto" else config.engine
    # imported here, since either takes a second that the other does not need
    if name == "native":
        from getup_jax.physics.native import NativeEngine

        return NativeEngine(character, config)
    from getup_jax.physics.mjx import MjxEngine

    return MjxEngine(character, config, impl="warp" if name == "mjx-warp" else "jax")


def _fastest() -> str:
    """native on a CPU; mjx-warp on a GPU where it is installed, else mjx."""
    backend = jax.default_backend()
    if backend == "cpu":
        return "native"
    return "mjx-warp" if backend == "gpu" and importlib.util.find_spec("warp") else "mjx"
