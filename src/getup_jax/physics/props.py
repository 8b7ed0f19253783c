"""Balls that fly beside the character, and a racket in its hand: additions to its MJCF."""

from __future__ import annotations

import dataclasses


@dataclasses.dataclass(frozen=True)
class Ball:
    """A free body."""

    name: str
    radius_m: float
    mass_kg: float
    rgba: tuple[float, float, float, float] = (0.85, 0.75, 0.2, 1.0)
