from __future__ import annotations

import numpy as np
import pytest

from getup_jax.config import TerrainConfig
from getup_jax.evaluation.ground_kinds import Places, kind_of, kinds
from getup_jax.physics.terrain_map import make_terrain

CONFIG = TerrainConfig(region_size_m=16.0, slope_block_m=8.0, slope_deg=(10.0, 20.0, 45.0))


@pytest.fixture(scope="module")
def ground():
    return make_terrain(CONFIG)


def test_flat_and_rough_ground_have_names_of_their_own(ground):
    rng = np.random.default_rng(0)
    np.testing.assert_array_equal(kind_of(ground, ground.draw_spawn(0, 9, rng)), "flat ground")
    upper = np.array([[8.0, -4.0], [-8.0, 12.0], [8.0, 12.0]])  # of easy, medium and hard
    np.testing.assert_array_equal(kind_of(ground, upper), "rough")


@pytest.mark.parametrize("region", [1, 2, 3])
def test_slopes_are_told_apart_by_ten_degrees(ground, region):
    xy = ground.draw_spawn(region, 200, np.random.default_rng(0))
    xy = xy[ground.is_sloped(xy)]
    # the rise over a metre straight up the slope, not the normal that the names come from
    field, step = ground.field(), 1e-2
    rise = [
        (field.height(xy + step * axis) - field.height(xy - step * axis)) / (2 * step)
        for axis in np.eye(2)
    ]
    degrees = np.degrees(np.arctan(np.hypot(*rise)))
    for name, steep in zip(kind_of(ground, xy), degrees, strict=True):
        low, high = map(int, name.removeprefix("slope ").removesuffix("°").split("-"))
        assert low - 0.1 <= steep <= high + 0.1
        assert name in kinds()


def test_the_steepest_slope_of_a_region_belongs_to_its_own_kind(ground):
    """One of exactly 10 degrees is of 0 to 10."""
    xy = ground.draw_spawn(1, 400, np.random.default_rng(0))
    found = set(kind_of(ground, xy[ground.is_sloped(xy)]))
    assert found == {"slope 0-10°"}


def test_places_have_the_names_of_regions_and_grounds():
    xy = np.array([[-8.0, -8.0], [8.0, 12.0]])
    places = Places.of(np.array([0, 3]), xy, CONFIG)
    assert places.region.tolist() == ["flat", "hard"]
    assert places.kind.tolist() == ["flat ground", "rough"]
