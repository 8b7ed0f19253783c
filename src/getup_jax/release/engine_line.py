"""Success of one policy on several physics engines, side by side."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

ENGINES = "native", "mjx", "mjx-warp"


def engine_table(evaluations: Sequence[Mapping[str, Any]]) -> str:
    """A table with a row for each setting that was evaluated, and a column an engine.

    evaluations: of getting up, as `getup-eval --json` wrote them. Settings that were evaluated on
    one engine alone are left out; with none left the text is empty. Where they differ in the number
    of episodes the interval says so.
    """
    settings: dict[str, dict[str, Mapping[str, Any]]] = {}
    for result in evaluations:
        conditions = dict(result["conditions"])
        engine = conditions.pop("engine")
        settings.setdefault(json.dumps(conditions, sort_keys=True), {})[engine] = result
    rows = [found for found in settings.values() if len(found) > 1]
    if not rows:
        return ""
    names = [name for name in ENGINES if any(name in found for found in rows)]
    lines = [
        "The same starts on several engines, success:",
        "",
        f"| | {' | '.join(names)} |",
        f"|---|{'---|' * len(names)}",
    ]
    return "\n".join(lines + [_row(found, names) for found in rows])


def _row(found: Mapping[str, Mapping[str, Any]], names: Sequence[str]) -> str:
    of = next(iter(found.values()))["conditions"]
    title = f"{of['start']} starts, seed {of['seed']}, joint noise {of['start_noise_rad']:g} rad"
    cells = [_cell(found.get(name)) for name in names]
    return f"| {title} | {' | '.join(cells)} |"


def _cell(result: Mapping[str, Any] | None) -> str:
    if result is None:
        return "-"
    low, high = result["success_low"], result["success_high"]
    return f"{result['success']:.1%} ({low:.1%} - {high:.1%}, {result['episodes']})"
