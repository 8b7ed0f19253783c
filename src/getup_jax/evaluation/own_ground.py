"""A ground of one's own for an evaluation: `getup-eval --ground hills.png:24:2`."""

from __future__ import annotations

import argparse
import dataclasses
import math

from getup_jax.config import TerrainConfig

GROUND_HELP = (
    "your own ground in place of it: heights as PNG, .npy or MuJoCo height field, its side and "
    "height in metres (an .npy file has metres); for policies of irregular ground"
)


@dataclasses.dataclass(frozen=True)
class OwnGround:
    """A file of heights, and how large it is."""

    heights: str
    region_size_m: float
    height_m: float | None = None  # None: the file has metres

    def put_into(self, terrain: TerrainConfig) -> TerrainConfig:
        """The same settings on this ground; ConfigError where it is too large or too small."""
        return dataclasses.replace(terrain, **dataclasses.asdict(self))


def own_ground(text: str) -> OwnGround:
    """FILE:SIDE or FILE:SIDE:HEIGHT, lengths in metres; the file may have colons."""
    parts = text.rsplit(":", 2)
    if len(parts) == 3 and not _lengths(parts[1:]):
        parts = text.rsplit(":", 1)
    lengths = _lengths(parts[1:])
    if not parts[0] or not lengths:
        raise argparse.ArgumentTypeError(
            f"expected FILE:SIDE or FILE:SIDE:HEIGHT in metres, such as hills.png:24:2, got "
            f"{text!r}"
        )
    return OwnGround(parts[0], *lengths)


def _lengths(texts: list[str]) -> list[float]:
    """The lengths, or none where one is not above 0."""
    try:
        values = [float(text) for text in texts]
    except ValueError:
        return []
    return values if all(math.isfinite(v) and v > 0 for v in values) else []
