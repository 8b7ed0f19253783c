"""Where episodes start on irregular ground, so that one kind of ground is scored together."""

from __future__ import annotations

import dataclasses

import numpy as np

from getup_jax.config import TerrainConfig
from getup_jax.physics.terrain_map import REGIONS, TerrainMap, make_terrain

STEP_DEG = 10  # slopes are told apart by this much
STEEPEST_DEG = 60  # that a config may ask for
FLAT, ROUGH = "flat ground", "rough"


@dataclasses.dataclass(frozen=True, eq=False)
class Places:
    """Where N episodes start."""

    region: np.ndarray  # [N] names, of REGIONS
    kind: np.ndarray  # [N] names, of `kinds()`

    @classmethod
    def of(cls, region: np.ndarray, xy: np.ndarray, config: TerrainConfig) -> Places:
        """Those of episodes in the regions [N], indices into REGIONS, at xy [N, 2] (m)."""
        return cls(np.array(REGIONS)[region], kind_of(make_terrain(config), xy))


def kinds() -> tuple[str, ...]:
    """Names of all kinds of ground: flat, rough, and slopes in steps of ten degrees."""
    return FLAT, ROUGH, *(_slope(low) for low in range(0, STEEPEST_DEG, STEP_DEG))


def kind_of(ground: TerrainMap, xy: np.ndarray) -> np.ndarray:
    """The kind of ground [N] at places xy [N, 2] (m)."""
    steep = np.degrees(np.arccos(np.clip(ground.field().normal(xy)[:, 2], -1.0, 1.0)))
    # a slope of exactly 10 degrees is of 0 to 10, whatever the rounding of its normal says
    low = STEP_DEG * np.maximum(np.ceil(steep / STEP_DEG - 1e-3).astype(int) - 1, 0)
    slope = np.array([_slope(degrees) for degrees in low])
    irregular = np.where(ground.is_sloped(xy), slope, ROUGH)
    return np.where(ground.region(xy) == 0, FLAT, irregular)


def _slope(low: int) -> str:
    return f"slope {low}-{low + STEP_DEG}°"
