"""What `getup-bench` prints and writes."""

from __future__ import annotations

import math
from typing import Any

from rich.table import Table

from getup_jax import __version__
from getup_jax.evaluation.bench import VERSION, Cell, Result, suites
from getup_jax.evaluation.verdicts import RULES
from getup_jax.runtime.console import as_text

_HEADINGS = {"ours": "ours", "sca2022": "SCA 2022", "thesis": "thesis", "host": "HoST"}


def table(result: Result) -> str:
    """Success and its 95 % interval by each rule: suites, grounds and pushes, and all."""
    view = Table("starts", "ground", "push Ns", "episodes", title=result.name)
    for rule in RULES:
        view.add_column(_HEADINGS[rule], no_wrap=True)
    for suite in suites(result.quick):
        for cell in (cell for cell in result.cells if cell.suite == suite):
            view.add_row(cell.suite, cell.ground, f"{cell.push_ns:g}", *_figures(cell))
        view.add_section()
    view.add_row("all", "", "", *_figures(result.total()))
    missing = f"not run: {', '.join(result.missing)}\n" if result.missing else ""
    return as_text(view, width=120) + missing


def _figures(cell: Cell) -> list[str]:
    shares = [cell.share(rule) for rule in RULES]
    return [str(cell.episodes), *(f"{x:4.0%} ({low:.0%}-{high:.0%})" for x, low, high in shares)]


def to_json(result: Result) -> dict[str, Any]:
    """Plain values; NaN becomes null."""
    motion = {
        suite: {name: None if math.isnan(x) else x for name, x in values.items()}
        for suite, values in result.motion.items()
    }
    return {
        "benchmark": {"version": VERSION, "quick": result.quick, "getup_jax": __version__},
        "policy": {"name": result.name, **result.facts},
        "missing": result.missing,
        "all": _success(result.total()),
        "cells": [
            {
                "starts": cell.suite,
                "ground": cell.ground,
                "push_ns": cell.push_ns,
                "episodes": cell.episodes,
                "success": _success(cell),
            }
            for cell in result.cells
        ],
        "motion": motion,
    }


def _success(cell: Cell) -> dict[str, Any]:
    found = {}
    for rule in RULES:
        share, low, high = cell.share(rule)
        found[rule] = {"share": share, "low": low, "high": high}
    return found
