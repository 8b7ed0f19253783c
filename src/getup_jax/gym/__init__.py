"""Environments for Gymnasium; importing this module registers them.

    import gymnasium  # pyright: ignore[reportMissingImports]
    import getup_jax.gym

    envs = gymnasium.make_vec("GetUp-v0", num_envs=64, config="quick")

`make_vec("getup_jax.gym:GetUp-v0", ...)` needs no import. See docs/gymnasium.md.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from typing import Any

from getup_jax.config import ConfigError
from getup_jax.runtime.extras import missing

try:
    import gymnasium  # pyright: ignore[reportMissingImports]
except ImportError:
    raise ImportError(missing("gymnasium", "gym", "getup_jax.gym")) from None

# id: the config that it has unless another one is given
ENVIRONMENTS = {
    "GetUp-v0": "flat",
    "GetUp-Terrain-v0": "terrain",
    "CompositeWalk-v0": "composite_walk_location",
}

_LOADED = Path("/proc/self/maps")  # what libraries this process has loaded, on Linux

__all__ = ["ENVIRONMENTS", "register", "sb3_env"]


def register() -> None:
    """Add the environments to Gymnasium's registry, once."""
    for name, config in ENVIRONMENTS.items():
        if name not in gymnasium.registry:
            gymnasium.register(
                id=name,
                entry_point="getup_jax.gym.single_env:GetUpEnv",
                vector_entry_point="getup_jax.gym.vector_env:GetUpVectorEnv",
                kwargs={"config": config},
            )


def sb3_env(config: Any = "flat", num_envs: int = 1, **options: Any) -> Any:
    """A `VecEnv` of stable-baselines3; the options are those of `GetUpVectorEnv`.

    Raises ConfigError where stable-baselines3 is not installed.
    """
    from getup_jax.gym.vector_env import GetUpVectorEnv
    from getup_jax.runtime.extras import load_extra

    _load_triton()
    load_extra("stable_baselines3", "sb3", "sb3_env")
    from getup_jax.gym.sb3 import SB3VecEnv

    return SB3VecEnv(GetUpVectorEnv(num_envs, config, **options))


def _load_triton() -> None:
    """Load Triton before pictures are rendered; raises ConfigError where it is too late.

    It comes with torch and is loaded when that first trains. It and Mesa's software renderer bring
    an LLVM each, and the process crashes where Mesa's is the first one.
    """
    if "triton" in sys.modules or importlib.util.find_spec("triton") is None:
        return
    if _LOADED.exists() and "libLLVM" in _LOADED.read_text(encoding="utf-8"):
        raise ConfigError(
            "sb3_env: pictures were rendered before, and this process would crash when torch "
            "trains; make the environment first, or import triton at the start"
        )
    importlib.import_module("triton")


register()
