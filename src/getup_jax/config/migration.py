"""Configs of earlier versions: settings that moved, that are no more, and that came later.

A config that a run or a checkpoint saved has every setting of its time, so that what it lacks came
later, with a default that may be another than what the code did before. Configs that people write
hold differences alone; in these a setting of old is a mistake with an answer.
"""

from __future__ import annotations

import math
from typing import Any

from getup_jax.config.check import ConfigError, shown

# What a saved config without the key means; a key that is not here means its default.
THEN: dict[str, Any] = {
    "network.mirror": False,
    "prior.mirror": False,
}

# Settings that have other names now.
MOVED = {
    "task.clip_start": "curriculum.reference_start",
    "task.clip_everywhere": "curriculum.reference_everywhere",
    "task.paths": "curriculum.archive",
    "task.path_share": "curriculum.archive_share",
    "task.focus": "curriculum.prioritisation",
    "task.focus_even": "curriculum.even_styles",
    "task.short_share": "curriculum.short_share",
    "task.short_s": "curriculum.short_s",
    "task.assist": "curriculum.assistive_wrench",
    "task.assist_share": "curriculum.assisted_share",
    "task.head_grace_s": "curriculum.head_grace_s",
    "task.drawn_share": "curriculum.drawn_curves",
    "task.curve_noise": "curriculum.curve_noise",
    "task.duration_range": "curriculum.duration_range",
    "task.sharpness": "curriculum.reward_sharpness",
    "task.track_weight": "curriculum.track_weight",
    "task.track_sharpness": "curriculum.track_sharpness",
    "composite.rehearse": "composite.warm_start",
}

# Settings that are no more: the values with which what was trained is still the same (None: any),
# and what to do instead. They were tried and did not help, or nobody used them.
RETIRED: dict[str, tuple[tuple[Any, ...] | None, str]] = {
    "ppo.critic_rate_scale": (None, "use ppo.critic_learning_rate, not tied to the actor's"),
    "ppo.value_coefficient": (None, "leave it out: the critic has an optimiser of its own"),
    "task.assist_s": ((math.inf,), "leave it out: the wrench fades with success alone"),
    "task.assist_rates": (([0.02, 0.01],), "leave it out: the rates are constants"),
    "composite.task": (("composite",), "use curriculum.objectives=terms for a critic a term"),
    "composite.terms": ((["total"],), "use curriculum.objectives=terms for a critic a term"),
    "composite.meta_share": ((0.0,), "leave it out: it did not help"),
    "composite.cut_s": ((None,), "leave it out: it did not help"),
    "composite.cut_grows": ((False,), "leave it out: it did not help"),
    "composite.discriminator.memory": ((0,), "leave it out: it did not help"),
}

# A file with all of these sections was saved: configs that people write hold differences.
_SECTIONS = ("seed", "physics", "motion", "prior", "task", "network", "ppo", "train")
_ABSENT = object()


def migrated(values: dict[str, Any]) -> dict[str, Any]:
    """The values of a config file; those of a saved one as this version has them.

    Raises ConfigError where it was saved with a setting that is no more.
    """
    if any(name not in values for name in _SECTIONS):
        return values
    values = _copied(values)
    for key, (same, _) in RETIRED.items():
        value = _pop(values, key)
        if value is not _ABSENT and same is not None and value not in same:
            raise ConfigError(
                f"{key}: is no setting any more; what was trained with {shown(value)} needs the "
                "version that trained it"
            )
    for key, new in MOVED.items():
        value = _pop(values, key)
        section, name = new.split(".")
        none = section == "curriculum" and isinstance(values.get("composite"), dict)
        if value is not _ABSENT and not none:  # composite motion has no curriculum
            values.setdefault(section, {})[name] = value
    for key, value in THEN.items():
        section, name = key.split(".")
        if isinstance(values[section], dict):  # one that is switched off (null) stays so
            values[section].setdefault(name, value)
    return values


def refuse_old(values: dict[str, Any]) -> None:
    """Raise ConfigError, with what to use now, for a setting of earlier versions."""
    for key, new in MOVED.items():
        if _get(values, key) is not _ABSENT:
            raise ConfigError(f"{key}: is {new} now")
    for key, (_, instead) in RETIRED.items():
        if _get(values, key) is not _ABSENT:
            raise ConfigError(f"{key}: is no setting any more; {instead}")


def _copied(values: dict[str, Any]) -> dict[str, Any]:
    return {k: _copied(v) if isinstance(v, dict) else v for k, v in values.items()}


def _parent(values: dict[str, Any], key: str) -> tuple[Any, str]:
    """The innermost section of a key, and the key's last name."""
    *sections, name = key.split(".")
    inner: Any = values
    for section in sections:
        inner = inner.get(section) if isinstance(inner, dict) else None
    return inner, name


def _get(values: dict[str, Any], key: str) -> Any:
    inner, name = _parent(values, key)
    return inner.get(name, _ABSENT) if isinstance(inner, dict) else _ABSENT


def _pop(values: dict[str, Any], key: str) -> Any:
    inner, name = _parent(values, key)
    return inner.pop(name, _ABSENT) if isinstance(inner, dict) else _ABSENT
