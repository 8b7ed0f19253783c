"""The scores as text: how well it gets up, and how the motion feels."""

from __future__ import annotations

import math
from collections.abc import Mapping

from rich.table import Table

from getup_jax.evaluation.metrics import Scores
from getup_jax.runtime.console import as_text

# (score, heading, format); those without a format are made in `_cell`
_SUCCESS = (
    ("success", "success", "{:.0%}"),
    ("interval", "95 %", ""),
    ("success_pushed", "of pushed", "{:.0%}"),
    ("return_rate", "return rate", "{:.2f}"),
    ("return_rate_total", "total", "{:.2f}"),
    ("height_error_m", "height error m", "{:.3f}"),
    ("angle_error_rad", "angle error rad", "{:.2f}"),
    ("stand_time_s", "stands after s", "{:.1f}"),
    ("episodes", "episodes", "{:d}"),
)
_NATURALNESS = (
    ("jitter", "jitter rad/s³", "{:.0f}"),
    ("torque_nm", "torque Nm", "{:.1f}"),
    ("saturation", "at torque limit", "{:.2%}"),
    ("energy_j", "energy J", "{:.0f}"),
    ("offset_rad", "|Δq|₁ rad", "{:.2f}"),
    ("foot_slip_m_s", "foot slip m/s", "{:.3f}"),
    ("penetration_m", "overlap m", "{:.4f}"),
    ("penetration_max_m", "deepest m", "{:.3f}"),
    ("reference_error_m", "from the motion m", "{:.3f}"),
)
_Columns = tuple[tuple[str, str, str], ...]


def table(scores: Scores) -> str:
    """Two tables with the same rows: one a style, a way of lying, a region and kind of ground."""
    success = _SUCCESS
    if math.isnan(scores.success_pushed):
        success = tuple(column for column in _SUCCESS if column[0] != "success_pushed")
    return as_text(_view(scores, success), _view(scores, _NATURALNESS), width=200)


def _view(scores: Scores, columns: _Columns) -> Table:
    view = Table()
    view.add_column("get-up", no_wrap=True)
    for _, heading, _ in columns:
        view.add_column(heading)
    _add_rows(view, columns, scores.per_curve or {})
    _add_rows(view, columns, scores.per_orientation or {})
    _add_rows(view, columns, scores.per_region or {})
    _add_rows(view, columns, scores.per_ground or {})
    _add_rows(view, columns, {"all": scores})
    return view


def _add_rows(view: Table, columns: _Columns, rows: Mapping[str, Scores]) -> None:
    for name, row in rows.items():
        view.add_row(name, *(_cell(row, score, text) for score, _, text in columns))
    view.add_section()


def _cell(row: Scores, score: str, text: str) -> str:
    if score == "interval":
        return f"{row.success_low:.0%}-{row.success_high:.0%}"
    value = getattr(row, score)
    return "-" if math.isnan(value) else text.format(value)
