"""README.md of an exported policy: data, training, numbers and limits, from files alone."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from getup_jax.release import composite_card
from getup_jax.release.engine_line import engine_table
from getup_jax.runtime.checkpoint import LoadedPolicy
from getup_jax.runtime.console import duration

LOW_SUCCESS = 0.8  # curves below this are named as limits
_NAMED = 8  # curves that a card names as weak
_UNKNOWN = "unknown"

_CARD = """\
# {title}

{purpose}

    getup-eval --ckpt {folder}

## Training

| | |
|---|---|
{training}

## Numbers

{meaning}

{numbers}

## Limits

{limits}
"""

_PURPOSE = """\
A policy of getup_jax that gets a simulated humanoid up from the floor. This folder holds its
weights, its pose prior and every setting (config.yaml); checkpoint.json has a digest of each
file."""
_MEANING = """\
Without action noise; success is rising from lying without an early end and standing for the
whole standing phase. In brackets: 95 % Wilson interval."""


@dataclasses.dataclass(frozen=True)
class Provenance:
    """What the checkpoint itself does not say."""

    commit: str | None = None  # of the code
    wall_s: float | None = None  # of the whole training
    machine: str | None = None
    before: str | None = None  # the training of the policy that this one started from


def model_card(
    name: str,
    loaded: LoadedPolicy,
    provenance: Provenance,
    evaluations: Sequence[Mapping[str, Any]],
) -> str:
    """The text; evaluations are those that `getup-eval --json` wrote."""
    composite = loaded.config.composite_motion
    data = composite_card.data(loaded) if composite else _data(loaded)
    training = data | _training(loaded, provenance)
    numbers = composite_card.numbers if composite else _numbers
    limits = composite_card.limits() if composite else _limits(loaded, evaluations)
    tables = ["" if composite else engine_table(evaluations), *map(numbers, evaluations)]
    if not evaluations:
        limits.append("How well it does has not been measured.")
    return _CARD.format(
        title=f"Policy `{name}`",
        purpose=composite_card.PURPOSE if composite else _PURPOSE,
        folder=name,
        training="\n".join(f"| {key} | {value} |" for key, value in training.items()),
        meaning=composite_card.MEANING if composite else _MEANING,
        numbers="\n\n".join(filter(None, tables)) or "Not evaluated yet.",
        limits="\n".join(f"- {limit}" for limit in limits),
    )


def _data(loaded: LoadedPolicy) -> dict[str, str]:
    motion = loaded.config.motion
    return {
        "data": f"motions {', '.join(motion.source)}",
        "curves": ", ".join(motion.curves) or "all of them",
    }


def _training(loaded: LoadedPolicy, provenance: Provenance) -> dict[str, str]:
    config, steps = loaded.config, loaded.metadata.get("steps")
    wall_s = provenance.wall_s
    began = {} if provenance.before is None else {"started from": provenance.before}
    return {
        "control steps": _UNKNOWN if steps is None else f"{steps:,}",
        **began,
        "wall time": _UNKNOWN if wall_s is None else duration(wall_s),
        "machine": provenance.machine or _UNKNOWN,
        "seed": str(config.seed),
        "commit": provenance.commit or _UNKNOWN,
    }


def _numbers(result: Mapping[str, Any]) -> str:
    """One evaluation: its conditions, all of it, by region, ground and orientation, the worst."""
    regions = {f"region {name}": row for name, row in (result.get("per_region") or {}).items()}
    grounds = result.get("per_ground") or {}
    rows = {"all": result, **regions, **grounds, **(result.get("per_orientation") or {})}
    curves = result.get("per_curve") or {}
    if curves:
        worst = min(curves, key=lambda name: curves[name]["success"])
        rows[f"worst curve: {worst}"] = curves[worst]
    head = "| | success | height error m | angle error rad | jitter rad/s³ | energy J | episodes |"
    lines = [_conditions(result["conditions"]), "", head, "|---|---|---|---|---|---|---|"]
    return "\n".join(lines + [_row(name, row) for name, row in rows.items()] + gain_line(result))


def gain_line(result: Mapping[str, Any]) -> list[str]:
    """A line on what is done of small edits of the curves, where that was measured."""
    found = result.get("control_gain")
    if not found:
        return []
    done = ", ".join(
        f"{name.replace('_', ' ')} {_number(row['gain'], '.2f')} "
        f"({_number(row['correlation'], '.2f')})"
        for name, row in found.items()
    )
    return ["", f"Done of what small edits of the curves ask for (correlation): {done}."]


def _row(name: str, row: Mapping[str, Any]) -> str:
    low, high = row["success_low"], row["success_high"]
    cells = [
        name,
        f"{row['success']:.1%} ({low:.1%} - {high:.1%})",
        _number(row["height_error_m"], ".3f"),
        _number(row["angle_error_rad"], ".2f"),
        _number(row["jitter"], ".0f"),
        _number(row["energy_j"], ".0f"),
        str(row["episodes"]),
    ]
    return f"| {' | '.join(cells)} |"


def _number(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)


def _conditions(of: Mapping[str, Any]) -> str:
    low, high = of["duration_scale"]
    parts = [f"{of['start'].capitalize()} starts", f"seed {of['seed']}", f"engine {of['engine']}"]
    parts += [f"joint noise {of['start_noise_rad']:g} rad", f"durations T x U({low:g}, {high:g})"]
    if of.get("motions") is not None:
        parts.append(f"motions of {Path(of['motions']).name}")
    if of.get("curves"):
        parts.append(f"curves of {', '.join(Path(file).name for file in of['curves'])}")
    if of.get("ground") is not None:
        parts.append(f"ground of {Path(of['ground']['heights']).name}")
    if of.get("terrain_seed") is not None:
        parts.append(f"ground of seed {of['terrain_seed']}")
    if of.get("drops") is not None:
        parts.append(f"bodies as of --drops {of['drops']}")
    if of["blend"] is not None:
        parts.append(f"mixtures of two curves ({of['blend']})")
    if of["push_ns"] is not None:
        parts.append(f"pushes of {of['push_ns']:g} Ns")
    if not of.get("early_termination", True):
        parts.append("no early ends")
    return f"{', '.join(parts)}; {of['stand_time_s']:g} s of standing:"


def _limits(loaded: LoadedPolicy, evaluations: Sequence[Mapping[str, Any]]) -> list[str]:
    body = (
        f"Trained for the character `{loaded.config.physics.character}` on the ground and with "
        "the servos of config.yaml; no other body or machine."
    )
    drawn = loaded.config.training_aids.drawn_curves > 0
    known = (
        "Trained on curves drawn around those of its styles"
        if drawn
        else "Trained on the curves of its styles"
    )
    tell = "`getup-eval --edits`" if drawn else "`getup-eval --blend`"
    curves = f"{known}; others need an evaluation first ({tell})."
    return [body, curves, *weak_curves(evaluations)]


def weak_curves(evaluations: Sequence[Mapping[str, Any]]) -> list[str]:
    """A line on the curves that often fail, each with its worst evaluation; or none."""
    worst: dict[str, float] = {}
    for result in evaluations:
        of = result["conditions"]
        own = of["blend"] is None and of.get("motions") is None and not of.get("curves")
        if of["start"] == "lying" and own:  # the curves that it was trained on
            for name, part in (result.get("per_curve") or {}).items():
                worst[name] = min(part["success"], worst.get(name, 1.0))
    weak = sorted(((rate, name) for name, rate in worst.items() if rate < LOW_SUCCESS))
    if not weak:
        return []
    some = ", ".join(f"{name} ({rate:.0%})" for rate, name in weak[:_NAMED])
    which = f"Curves that succeed in less than {LOW_SUCCESS:.0%}"
    if len(weak) > _NAMED:
        which += f" in one of these evaluations: {len(weak)} of {len(worst)}. The worst"
    return [f"{which}: {some}."]
