from __future__ import annotations

import re

import mujoco
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from getup_jax.config import ConfigError, TerrainConfig
from getup_jax.physics.height_file import own_heights, steepness
from getup_jax.physics.terrain_map import REGIONS, make_terrain
from getup_jax.physics.terrain_model import replace_floor

SIDE = 16.0
HILLS = gaussian_filter(np.random.default_rng(0).normal(size=(65, 65)), 6)
HILLS = HILLS / np.ptp(HILLS) * 2.0  # m


def config(file, **settings) -> TerrainConfig:
    return TerrainConfig(heights=str(file), region_size_m=SIDE, **settings)


@pytest.fixture(scope="module")
def hills(tmp_path_factory):
    file = tmp_path_factory.mktemp("hills") / "hills.npy"
    np.save(file, HILLS)
    return file


def ramp(columns: int = 33) -> np.ndarray:
    """Heights that rise by one step a column."""
    return np.tile(np.arange(columns, dtype=float), (columns, 1))


def test_metres_of_an_npy_file_stay_metres(tmp_path):
    np.save(tmp_path / "ramp.npy", 0.25 * ramp())
    found = own_heights(config(tmp_path / "ramp.npy"))
    assert found.shape == (33, 33)
    np.testing.assert_allclose(np.diff(found, axis=1), 0.25)
    np.testing.assert_allclose(np.diff(found, axis=0), 0.0, atol=1e-12)
    assert np.median(found) == pytest.approx(0.0)
    assert steepness(found, 0.5).max() == pytest.approx(np.degrees(np.arctan(0.5)))


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_grey_levels_are_scaled_to_the_height_and_north_is_up(tmp_path, kind):
    image = pytest.importorskip("PIL.Image")
    most = np.iinfo(kind).max
    levels = np.round(ramp().T / 32 * most).astype(kind)  # white at the bottom: the south is high
    image.fromarray(levels).save(tmp_path / "ramp.png")
    found = own_heights(config(tmp_path / "ramp.png", height_m=4.0))
    assert np.ptp(found) == pytest.approx(4.0)
    np.testing.assert_allclose(np.diff(found, axis=0), -4.0 / 32, atol=4.0 / most)


def test_a_mujoco_height_field_is_the_one_that_mujoco_reads(tmp_path):
    file = tmp_path / "hills.bin"
    with file.open("wb") as stream:
        np.array(HILLS.shape, np.int32).tofile(stream)
        HILLS.astype(np.float32).tofile(stream)
    found = own_heights(config(file, height_m=2.0, grid_step_m=0.5))
    spec = mujoco.MjSpec()
    spec.add_hfield(name="h", file=str(file), size=[8, 8, 2, 1])
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="h")
    theirs = 2.0 * spec.compile().hfield_data.reshape(65, 65)[::2, ::2]
    np.testing.assert_allclose(found - found.min(), theirs - theirs.min(), atol=1e-5)


def test_regions_are_a_third_two_thirds_and_all_of_it(hills):
    ground = make_terrain(config(hills))
    heights, field = own_heights(config(hills)), ground.field()
    inner = np.array([[-3.0, 2.5], [1.0, -1.5], [4.5, 4.0]])
    row, column = ((inner[:, ::-1] + SIDE / 2) / 0.5).astype(int).T
    for index, name in enumerate(REGIONS):
        place = inner + SIDE * (np.array([index % 2, index // 2]) - 0.5)
        np.testing.assert_array_equal(ground.region(place), index)
        expected = heights[row, column] * index / 3
        np.testing.assert_allclose(field.height(place), expected, atol=1e-6, err_msg=name)
    spec = mujoco.MjSpec.from_string(
        '<mujoco><worldbody><geom name="floor" type="plane" size="0 0 1"/></worldbody></mujoco>'
    )
    replace_floor(spec, ground)
    assert np.ptp(spec.compile().hfield_data) == pytest.approx(1.0)


def test_starts_are_away_from_edges_and_from_steep_places(tmp_path):
    heights = np.zeros((33, 33))
    heights[20:, :] = 0.8  # a step of 58 degrees
    np.save(tmp_path / "step.npy", heights)
    ground = make_terrain(config(tmp_path / "step.npy"))
    xy = ground.draw_spawn(3, 500, np.random.default_rng(0))
    np.testing.assert_array_equal(ground.region(xy), 3)
    assert (xy.min() >= 3.0) & (xy.max() <= SIDE - 3.0)
    assert np.abs(xy[:, 1] - 9.75).min() > 1.0
    assert ground.is_sloped(xy).all()  # its level parts are even
    assert not ground.is_sloped(np.array([[8.0, 9.75]])).any()


@pytest.mark.parametrize(
    ("values", "settings", "message"),
    [
        (np.zeros((8, 8, 3)), {}, r"expected heights of two dimensions, got float64 of shape"),
        (np.zeros(64), {}, r"expected heights of two dimensions"),
        (np.zeros((8, 8), complex), {}, r"two dimensions, got complex128"),
        (np.zeros((2, 2)), {}, r"expected 4 to 10000 points a side, got 2 x 2"),
        (np.zeros((40, 20)), {}, r"expected a square, got 40 x 20; crop it"),
        (np.where(np.eye(9) > 0, np.nan, 0.0), {}, r"row 0, column 0: expected a finite height"),
        (2000.0 * ramp(), {}, r"expected heights in metres, got 0 to 64000; give terrain.height_m"),
        (1.5 * ramp(), {}, r"its steepest place has 72 degrees, expected at most 60"),
        (ramp(), {"height_m": 15.0}, r"no place of the region 'hard' is less than 40 degrees"),
    ],
)
def test_what_is_no_ground_is_said_in_one_line(tmp_path, values, settings, message):
    np.save(tmp_path / "a.npy", values)
    with pytest.raises(ConfigError, match=message) as caught:
        make_terrain(config(tmp_path / "a.npy", **settings))
    assert str(caught.value).startswith("terrain.heights: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.tif", b"", r"expected a file that ends in \.png, \.npy"),
        ("a.npy", None, "no such file"),
        ("a.npy", b"no array", r"cannot be read: it is no \.npy file; save it with numpy\.save$"),
        ("a.npy", b"", r"cannot be read: it is no \.npy file"),
        ("a.png", b"no picture", "cannot be read: "),
        ("a.bin", np.array([9, 9, 0], np.int32).tobytes(), "says 9 x 9 heights, and 1 follow"),
        ("a.bin", b"\0\0", "cannot be read: "),
    ],
)
def test_a_file_that_cannot_be_read_is_said(tmp_path, name, content, message):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(ConfigError, match=message) as caught:
        own_heights(config(tmp_path / name, height_m=1.0))
    assert re.match(r"terrain\.heights: \S+a\.\w+: ", str(caught.value))
    assert "\n" not in str(caught.value)


def test_a_picture_needs_a_height_and_one_channel(tmp_path):
    image = pytest.importorskip("PIL.Image")
    image.fromarray(np.zeros((8, 8), np.uint8)).save(tmp_path / "grey.png")
    with pytest.raises(ConfigError, match=r"grey\.png: give terrain\.height_m, from its lowest"):
        own_heights(config(tmp_path / "grey.png"))
    image.fromarray(np.zeros((8, 8, 3), np.uint8)).save(tmp_path / "colour.png")
    with pytest.raises(ConfigError, match=r"uint8 of shape \(8, 8, 3\); save one grey channel"):
        own_heights(config(tmp_path / "colour.png", height_m=1.0))
    image.fromarray(np.zeros((8, 8), np.uint8)).convert("P").save(tmp_path / "palette.png")
    with pytest.raises(ConfigError, match=r"colours are of a palette; save it with one grey"):
        own_heights(config(tmp_path / "palette.png", height_m=1.0))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"height_m": 2.0}, r"terrain\.height_m: expected null, as it belongs to terrain\.heights"),
        ({"heights": "a.npy", "region_size_m": 6.0}, r"region_size_m: expected at least 8 m"),
        ({"heights": "a.npy", "region_size_m": 16.5}, r"expected a multiple of 2 x terrain\.grid"),
        ({"heights": "a.npy", "height_m": 0.0}, r"terrain\.height_m: expected .*more than 0"),
    ],
)
def test_settings_that_do_not_fit_are_said(settings, message):
    with pytest.raises(ConfigError, match=message):
        TerrainConfig(**settings)
