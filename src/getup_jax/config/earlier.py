"""What settings meant before they were settings, for configs that were saved then.

A config that a run or a checkpoint saved has every setting of its time. One that it lacks came
later, with a default that may be another than what the code did before. `THEN` says what it did.
"""

from __future__ import annotations

from typing import Any

# What a saved config without the key means; a key that is not here means its default.
THEN: dict[str, Any] = {
    "network.mirror": False,
    "prior.mirror": False,
}

# A file with all of these sections was saved: configs that people write hold differences.
_SECTIONS = ("seed", "physics", "motion", "prior", "task", "network", "ppo", "train")


def completed(values: dict[str, Any]) -> dict[str, Any]:
    """The values of a config file; those of a saved one with the keys that it lacks.

    A section that is switched off (null) stays so.
    """
    if any(name not in values for name in _SECTIONS):
        return values
    result = dict(values)
    for key, value in THEN.items():
        section, name = key.split(".")
        if isinstance(result[section], dict):
            result[section] = {name: value} | result[section]
    return result
