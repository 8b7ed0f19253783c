"""What `getup-motion` says about a file: its clip, its get-ups, its warnings."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from getup_jax.motion.clips import Clip, GetUp, MotionError
from getup_jax.motion.getup.events import DEFAULTS, heights_of, lies, link_positions
from getup_jax.motion.getup.getups import find_getups
from getup_jax.motion.retarget.cache import Result
from getup_jax.motion.retarget.retarget import RetargetReport
from getup_jax.physics.character import CharacterSpec


@dataclasses.dataclass(frozen=True, eq=False)
class FileReport:
    """One motion file after its import; `clip` is None where it failed."""

    path: Path
    clip: Clip | None
    retarget: RetargetReport | None
    getups: tuple[GetUp, ...]
    events: tuple[dict[str, Any], ...]
    warnings: tuple[str, ...]
    errors: tuple[str, ...]

    def plain(self) -> dict[str, Any]:
        """The report as JSON-ready values; frames are those of the clip."""
        return {
            "file": str(self.path),
            "frames": self.retarget.frames if self.retarget else 0,
            "events": list(self.events),
            "position_error_m": self.retarget.position_error_m if self.retarget else None,
            "worst_error_m": self.retarget.worst_error_m if self.retarget else None,
            "clipped": self.retarget.clipped if self.retarget else None,
            "penetration_m": self.retarget.penetration_m if self.retarget else None,
            "jump_rad": self.retarget.jump_rad if self.retarget else None,
            "warnings": list(self.warnings),
            "errors": list(self.errors),
        }


def report_of(path: Path, result: Result, character: CharacterSpec) -> FileReport:
    """Find the get-ups of a retargeted file and collect what its user should know."""
    if isinstance(result, MotionError):
        return FileReport(path, None, None, (), (), (), (str(result),))
    clip, retarget = result
    warnings = list(retarget.warnings)
    if retarget.unknown_joints:
        warnings.append(f"joints without a link: {', '.join(retarget.unknown_joints)}")
    events, getups = find_getups(clip, character)
    if not events:
        heights = heights_of(link_positions(clip, character), character)
        lying = lies(heights, DEFAULTS).any()
        reason = "it lies but does not stand up" if lying else "it never lies"
        warnings.append(f"no get-up found: {reason}")
    plain = tuple(
        {
            "start": event.lie_start,
            "rise": event.last_flat,
            "end": event.stand,
            "orientation": event.orientation,
            "strategy": getup.strategy,
            "name": getup.name,
        }
        for event, getup in zip(events, getups, strict=True)
    )
    return FileReport(path, clip, retarget, tuple(getups), plain, tuple(warnings), ())


def file_table(reports: list[FileReport]) -> Table:
    """One row a file."""
    table = Table(title="motion files")
    table.add_column("file", no_wrap=True)
    for name in ("frames", "get-ups", "mean\ncm", "worst\ncm", "limit\n%", "deep\ncm", "jump\nrad"):
        table.add_column(name, justify="right")
    for report in reports:
        if report.retarget is None:
            table.add_row(report.path.name, "failed", *["-"] * 6, style="red")
            continue
        r = report.retarget
        table.add_row(
            *(report.path.name, str(r.frames), str(len(report.getups))),
            *(f"{100 * r.position_error_m:.1f}", f"{100 * r.worst_error_m:.1f}"),
            *(f"{100 * r.clipped:.1f}", f"{100 * r.penetration_m:.1f}", f"{r.jump_rad:.2f}"),
        )
    return table


def getup_table(getups: tuple[GetUp, ...]) -> Table:
    """One row a get-up."""
    table = Table(title=f"{len(getups)} get-ups")
    table.add_column("name", no_wrap=True, min_width=max((len(g.name) for g in getups), default=4))
    for name in ("time\ns", "neck from\nto m", "fit error\ncm, deg, deg", "strategy"):
        table.add_column(name)
    for getup in getups:
        error = getup.fit_error
        fit = (
            "-"
            if error is None
            else f"{100 * error[0]:.0f}, "
            + ", ".join(f"{np.degrees(value):.0f}" for value in error[1:])
        )
        neck = f"{getup.points[0, 0]:.2f} {getup.points[-1, 0]:.2f}"
        table.add_row(getup.name, f"{getup.duration:.1f}", neck, fit, getup.strategy or "-")
    return table


def event_table(report: FileReport, fps: float) -> Table:
    """One row an event."""
    table = Table(title=f"{report.path.name}: {len(report.events)} get-ups at {fps:g} fps")
    for name in ("lies from", "rises from", "stands at", "rise", "lying", "strategy"):
        table.add_column(name)
    for event in report.events:
        rise = (event["end"] - event["rise"]) / fps
        table.add_row(
            *(str(event[name]) for name in ("start", "rise", "end")),
            *(f"{rise:.2f} s", event["orientation"], event["strategy"]),
        )
    return table
