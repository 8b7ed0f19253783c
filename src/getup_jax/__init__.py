"""A simulator and trainer that teaches a physics-based humanoid to get up.

`load_policy`, `make_env`, `train`, `evaluate`, `load_config`, `Scenario`, `Policy`, `Env`, `Goal`,
`GoalOutput`, `register_goal` and `register_reward` are the front door, see docs/python.md; they are
imported when they are first used, since commands that only answer a wrong option must not wait for
JAX.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from getup_jax.api import (
        Env,
        Goal,
        GoalOutput,
        Policy,
        Scenario,
        evaluate,
        load_config,
        load_policy,
        make_env,
        register_goal,
        register_reward,
        train,
    )

__version__ = "0.1.0"
__all__ = [
    "Env",
    "Goal",
    "GoalOutput",
    "Policy",
    "Scenario",
    "evaluate",
    "load_config",
    "load_policy",
    "make_env",
    "register_goal",
    "register_reward",
    "train",
]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from getup_jax import api

    return getattr(api, name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
