"""Heights that users bring: PNG, .npy or MuJoCo's height field, on the grid of the ground."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import map_coordinates

from getup_jax.config import ConfigError, TerrainConfig
from getup_jax.runtime.extras import load_extra

SUFFIXES = (".png", ".npy", ".bin", ".hfield")
STEEPEST_DEG = 60.0  # of a triangle of the ground
_LEAST, _MOST = 4, 10_000  # points along a side
_LARGEST_M = 1000.0
_SQUARE = 0.01  # the sides may differ by this share


def own_heights(config: TerrainConfig) -> np.ndarray:
    """Heights [n, n] (m) of `terrain.heights`, rows along y from the south; the edge is about 0.

    The field is sampled at the points of the grid, with linear steps between its own. Raises
    ConfigError where it is no ground to get up from.
    """
    where = f"terrain.heights: {config.heights}"
    values = _scaled(_read(Path(str(config.heights)).expanduser(), where), config, where)
    count = round(config.region_size_m / config.grid_step_m) + 1
    rows, columns = (np.linspace(0, side - 1, count) for side in values.shape)
    sampled = map_coordinates(values, np.meshgrid(rows, columns, indexing="ij"), order=1)
    edge = np.concatenate([sampled[0], sampled[-1], sampled[:, 0], sampled[:, -1]])
    sampled = sampled - np.median(edge)
    steepest = float(steepness(sampled, config.grid_step_m).max())
    if steepest > STEEPEST_DEG:
        raise ConfigError(
            f"{where}: its steepest place has {steepest:.0f} degrees, expected at most "
            f"{STEEPEST_DEG:.0f}; make terrain.height_m smaller or terrain.region_size_m larger"
        )
    return sampled


def steepness(heights: np.ndarray, step: float) -> np.ndarray:
    """Slope [n - 1, m - 1] (degrees) of the steeper triangle of every cell of heights [n, m]."""
    a, b, c, d = heights[:-1, :-1], heights[:-1, 1:], heights[1:, :-1], heights[1:, 1:]
    rise = np.maximum(np.hypot(b - a, d - b), np.hypot(d - c, c - a))
    return np.degrees(np.arctan(rise / step))


def _read(path: Path, where: str) -> np.ndarray:
    """The values of a file [rows, columns], rows along y."""
    if path.suffix.lower() not in SUFFIXES:
        raise ConfigError(f"{where}: expected a file that ends in {', '.join(SUFFIXES)}")
    if not path.is_file():
        raise ConfigError(f"{where}: no such file")
    readers = {".png": _read_png, ".npy": _read_npy}
    try:
        values = readers.get(path.suffix.lower(), _read_hfield)(path)
    except ConfigError:
        raise
    except Exception as error:  # decoders fail in many ways
        text = " ".join(str(error).split()) or type(error).__name__
        raise ConfigError(f"{where}: cannot be read: {text}") from None
    if values.dtype.kind not in "biuf" or values.ndim != 2:
        raise ConfigError(
            f"{where}: expected heights of two dimensions, got {values.dtype} of shape "
            f"{values.shape}; save one grey channel or a 2-D array of numbers"
        )
    rows, columns = values.shape
    if not _LEAST <= min(values.shape) <= max(values.shape) <= _MOST:
        raise ConfigError(
            f"{where}: expected {_LEAST} to {_MOST} points a side, got {rows} x {columns}"
        )
    if abs(rows - columns) > _SQUARE * max(rows, columns):
        raise ConfigError(f"{where}: expected a square, got {rows} x {columns}; crop it")
    return values.astype(np.float64)


def _scaled(values: np.ndarray, config: TerrainConfig, where: str) -> np.ndarray:
    """In metres: as they are, or from 0 to terrain.height_m."""
    bad = np.argwhere(~np.isfinite(values))
    if len(bad):
        row, column = bad[0]
        raise ConfigError(
            f"{where}: row {row}, column {column}: expected a finite height, got "
            f"{values[row, column]}; fill the holes ({len(bad)} of {values.size})"
        )
    low, high = float(values.min()), float(values.max())
    if config.height_m is not None:
        return (values - low) / max(high - low, 1e-12) * config.height_m
    if not str(config.heights).lower().endswith(".npy"):
        raise ConfigError(f"{where}: give terrain.height_m, from its lowest to its highest place")
    if high - low > _LARGEST_M:
        raise ConfigError(
            f"{where}: expected heights in metres, got {low:g} to {high:g}; give terrain.height_m"
        )
    return values


def _read_png(path: Path) -> np.ndarray:
    image: Any = load_extra("PIL.Image", "plot", "terrain.heights").open(path)
    if image.mode == "P":  # its numbers are places in a table of colours
        raise ValueError("its colours are of a palette; save it with one grey channel")
    return np.asarray(image)[::-1]  # north is up


def _read_npy(path: Path) -> np.ndarray:
    with path.open("rb") as file:
        head = file.read(len(np.lib.format.MAGIC_PREFIX))
    if head != np.lib.format.MAGIC_PREFIX:
        raise ValueError("it is no .npy file; save it with numpy.save")
    return np.load(path, mmap_mode="r", allow_pickle=False)


def _read_hfield(path: Path) -> np.ndarray:
    """MuJoCo's own: rows and columns as int32, then the heights as float32."""
    rows, columns = (int(n) for n in np.fromfile(path, np.int32, 2))
    values = np.fromfile(path, np.float32, offset=8)
    if min(rows, columns) < 1 or rows * columns != len(values):
        raise ValueError(f"its head says {rows} x {columns} heights, and {len(values)} follow")
    return values.reshape(rows, columns)
