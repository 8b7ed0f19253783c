"""The shape of irregular ground: four regions from a seed, and where bodies may start on it.

Seen from above, x to the right; the regions are flat, easy, medium and hard. The lower half of
each irregular region has hills and hollows, pyramids of four even slopes, and the upper half
is rough: tiles whose corners are moved up and down [P 3.2 and figure 3].

    medium | hard
    flat   | easy

A ground of one's own (`terrain.heights`) takes the place of the irregular ones: a third of its
heights is easy, two thirds are medium, and as it is it is hard.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter

from getup_jax.config import ConfigError, TerrainConfig
from getup_jax.physics.height_file import own_heights, steepness
from getup_jax.physics.terrain import HeightField

REGIONS = ("flat", "easy", "medium", "hard")
_SPAWN_STEP_M = 0.5  # side of a spawn cell
_SPAWN_MARGIN_M = 1.0  # from the edges of a region, and from the foot of a slope
_CREASE_MARGIN_M = 0.7  # from the edge between two slopes
_RAMP_M = 2.0  # from the edge of a ground of one's own, along which its heights begin
_STEEPEST_START_DEG = 40.0  # within a margin of a start on it
_EVEN = 0.1  # slopes (m a metre) of one even slope differ by less


@dataclasses.dataclass(frozen=True, eq=False)
class TerrainMap:
    """Heights on a square grid, and the places where bodies may start."""

    heights: np.ndarray  # [n, n] m, rows along y
    step: float  # m between two points of the grid
    region_size: float  # m
    spawn_xy: np.ndarray  # [S, 2] centres of the spawn cells (m)
    spawn_region: np.ndarray  # [S] index into REGIONS
    spawn_sloped: np.ndarray  # [S] bool, on an even slope; otherwise flat or rough
    even: np.ndarray | None = None  # [n - 1, n - 1] bool, cells on an even slope; None: by place

    @property
    def half(self) -> float:
        """Half the side of the whole field (m); its middle is the origin."""
        return 0.5 * self.step * (len(self.heights) - 1)

    @property
    def origin(self) -> np.ndarray:
        """x and y [2] of the first point of the grid (m)."""
        return np.array([-self.half, -self.half])

    def field(self) -> HeightField:
        """The same ground as the task sees it, in NumPy."""
        return HeightField.of(self.heights, self.origin, self.step)

    def cell(self, xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Row and column [...] of the cells below places xy [..., 2] (m), or the nearest ones."""
        cell = np.floor((np.asarray(xy) - self.origin) / self.step).astype(int)
        column, row = np.moveaxis(np.clip(cell, 0, len(self.heights) - 2), -1, 0)
        return row, column

    def region(self, xy: np.ndarray) -> np.ndarray:
        """Index into REGIONS of places xy [..., 2] (m); -1 outside all of them."""
        cell = np.floor(np.asarray(xy) / self.region_size).astype(int) + 1
        inside = ((cell >= 0) & (cell <= 1)).all(axis=-1)
        return np.where(inside, cell[..., 0] + 2 * cell[..., 1], -1)

    def is_sloped(self, xy: np.ndarray) -> np.ndarray:
        """Whether places xy [..., 2] (m) are in the half of an irregular region that has slopes.

        On a ground of one's own: whether the ground around them is one even slope.
        """
        if self.even is not None:
            return self.even[self.cell(xy)] & (self.region(xy) > 0)
        y = np.asarray(xy)[..., 1] % self.region_size
        return (self.region(xy) > 0) & (y < self.region_size / 2)

    def check_spawn(self, xy: np.ndarray) -> None:
        """Raise ConfigError if a place of xy [N, 2] (m) is outside the regions."""
        outside = np.asarray(xy)[self.region(xy) < 0]
        if len(outside):
            size = self.region_size
            raise ConfigError(
                f"terrain: the start at x, y = {outside[0].round(2).tolist()} is outside the "
                f"regions, which reach from {-size:g} to {size:g} m"
            )

    def draw_spawn(self, region: int, count: int, rng: np.random.Generator) -> np.ndarray:
        """Random places [count, 2] (m) in the spawn cells of a region, half of them on slopes."""
        own = np.flatnonzero(self.spawn_region == region)
        sloped = self.spawn_sloped[own]
        share = np.where(sloped, 1 / max(1, sloped.sum()), 1 / max(1, (~sloped).sum()))
        cell = rng.choice(own, size=count, p=share / share.sum())
        return self.spawn_xy[cell] + rng.uniform(-0.5, 0.5, (count, 2)) * _SPAWN_STEP_M


def own_ground(config: TerrainConfig) -> TerrainMap:
    """The ground of `terrain.heights`, in three sizes beside a flat region."""
    field, step, size = own_heights(config), config.grid_step_m, config.region_size_m
    points, border = len(field) - 1, round(config.border_m / step)
    inwards = step * np.minimum(np.arange(points + 1), np.arange(points, -1, -1))
    ramp = np.clip(inwards / _RAMP_M, 0.0, 1.0)  # no cliffs between the regions
    field = field * np.minimum(ramp[:, None], ramp)
    heights = np.zeros((2 * points + 1 + 2 * border,) * 2)
    for index in range(1, len(REGIONS)):
        column, row = border + points * (index % 2), border + points * (index // 2)
        heights[row : row + points + 1, column : column + points + 1] = (
            field * index / (len(REGIONS) - 1)
        )
    even, steep = _evenness(heights, step)
    ground = TerrainMap(heights, step, size, np.zeros((0, 2)), np.zeros(0), np.zeros(0), even)
    middles = np.arange(_SPAWN_STEP_M / 2 - size, size, _SPAWN_STEP_M)
    xy = np.stack(np.meshgrid(middles, middles), axis=-1).reshape(-1, 2)
    region, inside = ground.region(xy), np.abs(xy % size - size / 2)
    margin = np.where(region == 0, _SPAWN_MARGIN_M, _RAMP_M + _SPAWN_MARGIN_M)
    fair = (inside.max(axis=1) <= size / 2 - margin) & ~steep[ground.cell(xy)]
    for index, name in enumerate(REGIONS):
        if not fair[region == index].any():
            raise ConfigError(
                f"terrain.heights: {config.heights}: no place of the region {name!r} is less than "
                f"{_STEEPEST_START_DEG:g} degrees steep; make terrain.height_m smaller"
            )
    xy, region = xy[fair], region[fair]
    return dataclasses.replace(
        ground, spawn_xy=xy, spawn_region=region, spawn_sloped=ground.is_sloped(xy)
    )


def _evenness(heights: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Cells [n - 1, n - 1] on an even slope, and cells near a place too steep to start from."""
    z = heights
    slope = np.stack([z[1:, 1:] - z[1:, :-1], z[1:, 1:] - z[:-1, 1:]]) / step
    other = np.stack([z[:-1, 1:] - z[:-1, :-1], z[1:, :-1] - z[:-1, :-1]]) / step
    reach = 2 * round(_CREASE_MARGIN_M / step) + 1
    high = maximum_filter(np.maximum(slope, other), (1, reach, reach))
    low = minimum_filter(np.minimum(slope, other), (1, reach, reach))
    even = np.hypot(*(high - low)) < _EVEN
    wide = 2 * round(_SPAWN_MARGIN_M / step) + 1
    return even, maximum_filter(steepness(heights, step), wide) > _STEEPEST_START_DEG


def make_terrain(config: TerrainConfig) -> TerrainMap:
    """The ground of a config; the same seed gives the same ground.

    Raises ConfigError where `terrain.heights` cannot be used.
    """
    if config.heights is not None:
        return own_ground(config)
    rng = np.random.default_rng(config.seed)
    size, step = config.region_size_m, config.grid_step_m
    points, border = round(size / step), round(config.border_m / step)
    heights = np.zeros((2 * points + 1 + 2 * border,) * 2)
    for index in range(1, len(REGIONS)):
        column, row = border + points * (index % 2), border + points * (index // 2)
        part = heights[row : row + points + 1, column : column + points + 1]
        part[: points // 2 + 1] = _slopes(config, index - 1, rng)
        part[points // 2 :] = _rough(config, index - 1, rng)
    xy, region, sloped = _spawn_cells(config)
    return TerrainMap(heights, step, size, xy, region, sloped)


def _slopes(config: TerrainConfig, level: int, rng: np.random.Generator) -> np.ndarray:
    """Heights of half a region: in every block a hill or hollow of four even slopes.

    Every block has another slope, evenly spread up to the steepest one of the level. The edges
    between two slopes run along x and y, where MuJoCo's triangles do not cut them off.
    """
    block, step = round(config.slope_block_m / config.grid_step_m), config.grid_step_m
    columns = round(config.region_size_m / config.slope_block_m)
    rows = columns // 2
    gentlest = config.slope_deg[level - 1] if level else 0.0
    share = (1 + rng.permutation(rows * columns)) / (rows * columns)
    slope = np.radians(gentlest + (config.slope_deg[level] - gentlest) * share)
    rise = np.tan(slope) * rng.choice([-1, 1], size=len(slope))
    outwards = np.abs(np.arange(block + 1) - block / 2) * step
    pyramid = np.maximum(config.slope_block_m / 2 - outwards[:, None] - outwards, 0.0) / np.sqrt(
        2.0
    )
    heights = np.zeros((rows * block + 1, columns * block + 1))
    for index, factor in enumerate(rise):
        y, x = block * (index // columns), block * (index % columns)
        heights[y : y + block + 1, x : x + block + 1] = factor * pyramid
    return heights


def _rough(config: TerrainConfig, level: int, rng: np.random.Generator) -> np.ndarray:
    """Heights of half a region: corners of the tiles moved up and down, its edges left alone."""
    columns = round(config.region_size_m / config.tile_m)
    rows = round(config.region_size_m / 2 / config.tile_m)
    corners = np.zeros((rows + 1, columns + 1))
    limit = config.rough_m[level]
    corners[1:-1, 1:-1] = rng.uniform(-limit, limit, (rows - 1, columns - 1))
    fine = round(config.tile_m / config.grid_step_m)
    return _refine(_refine(corners, fine).T, fine).T


def _refine(values: np.ndarray, factor: int) -> np.ndarray:
    """Rows [n, m] with linear steps between them: [factor (n - 1) + 1, m]."""
    index = np.arange(factor * (len(values) - 1) + 1) / factor
    low = np.minimum(index.astype(int), len(values) - 2)
    share = (index - low)[:, None]
    return (1 - share) * values[low] + share * values[low + 1]


def _spawn_cells(config: TerrainConfig) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Centres [S, 2], regions [S] and whether on a slope [S] of all spawn cells."""
    size, margin = config.region_size_m, _SPAWN_MARGIN_M
    middles = np.arange(_SPAWN_STEP_M / 2, size, _SPAWN_STEP_M)
    x, y = (part.ravel() for part in np.meshgrid(middles, middles))
    whole = np.minimum.reduce([x, y, size - x, size - y]) >= margin
    rough = whole & (y >= size / 2 + margin)
    slope = (y < size / 2) & _on_a_face(config, x, y)
    cells, regions, sloped = [], [], []
    for index in range(len(REGIONS)):
        corner = size * np.array([index % 2 - 1, index // 2 - 1])
        for kind, chosen in ((False, rough if index else whole), (True, slope & (index > 0))):
            cells.append(np.stack([x, y], axis=-1)[chosen] + corner)
            regions.append(np.full(chosen.sum(), index))
            sloped.append(np.full(chosen.sum(), kind))
    return np.concatenate(cells), np.concatenate(regions), np.concatenate(sloped)


def _on_a_face(config: TerrainConfig, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Whether places of a region are on one even slope with room around them."""
    half = config.slope_block_m / 2
    offset = np.abs(np.stack([x, y]) % config.slope_block_m - half)  # from the middle
    from_foot = (half - offset.sum(axis=0)) / np.sqrt(2.0)
    return (from_foot >= _SPAWN_MARGIN_M) & (offset.min(axis=0) >= _CREASE_MARGIN_M)
