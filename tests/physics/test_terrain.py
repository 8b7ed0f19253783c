from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from mujoco import mjx
from mujoco.batch import Batch

from getup_jax.config import ConfigError, PhysicsConfig, TerrainConfig
from getup_jax.physics.character import load_character
from getup_jax.physics.terrain import HeightField, Terrain
from getup_jax.physics.terrain_map import REGIONS, TerrainMap, make_terrain
from getup_jax.physics.terrain_model import replace_floor

CONFIG = TerrainConfig(region_size_m=16.0, slope_block_m=8.0)
RADIUS = 0.01
SPHERE = f"""
<mujoco>
  <option timestep="0.005" integrator="implicitfast"/>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 1"/>
    <body><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>
      <body><joint type="slide" axis="0 0 1" damping="0.02"/>
        <geom type="sphere" size="{RADIUS}" density="1000" friction="0 0 0"/></body>
      <geom type="sphere" size="0.001" mass="1000" contype="0" conaffinity="0"/></body>
  </worldbody>
</mujoco>
"""


@pytest.fixture(scope="module")
def ground() -> TerrainMap:
    return make_terrain(CONFIG)


@pytest.fixture(scope="module")
def field(ground) -> HeightField:
    return ground.field()


def sphere_model(ground: TerrainMap) -> mujoco.MjModel:
    spec = mujoco.MjSpec.from_string(SPHERE)
    replace_floor(spec, ground)
    return spec.compile()


def places(ground: TerrainMap, count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-ground.half, ground.half, (count, 2))


def test_small_spheres_come_to_rest_on_the_height(ground, field):
    model, xy = sphere_model(ground), places(ground, 400)
    batch = Batch(model, len(xy))
    batch.qpos[:, :2] = xy
    batch.qpos[:, 2] = field.height(xy) + 0.03
    batch.step(nstep=400)
    rest = batch.qpos.copy()
    np.testing.assert_allclose(rest[:, :2], xy, atol=1e-3)  # a heavy carriage holds the place
    assert np.abs(batch.qvel[:, 2]).max() < 1e-3
    gap = field.clearance(rest, RADIUS)
    assert np.abs(gap).max() < 0.005
    assert np.abs(rest[:, 2]).max() > 1.0  # hills and hollows were among the places


def test_mjx_collides_with_the_same_surface(ground, field):
    model = sphere_model(ground)
    fast = mjx.put_model(model, impl="jax")
    data = mjx.make_data(model, impl="jax")
    xy = places(ground, 200, seed=1)
    z = field.height(xy)

    def depth(qpos):
        """Deepest contact of a sphere at qpos (m)."""
        moved = mjx.kinematics(fast, data.replace(qpos=qpos))
        return jnp.min(mjx.collision(fast, moved)._impl.contact.dist)

    start = jnp.asarray(np.column_stack([xy, z + RADIUS - 0.002]), jnp.float32)
    gap = jax.jit(jax.vmap(lambda qpos: field.clearance(qpos, RADIUS)))(start)
    found = jax.jit(jax.vmap(depth))(start)
    np.testing.assert_allclose(found, gap, atol=0.005)
    assert float(jnp.max(found)) < 0.0  # every sphere touches


def test_normals_belong_to_the_height(ground, field):
    xy = places(ground, 300, seed=2)
    slope = jax.vmap(jax.grad(field.height))(jnp.asarray(xy, jnp.float32))
    expected = np.concatenate([-slope, np.ones((len(xy), 1))], axis=1)
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    np.testing.assert_allclose(field.normal(xy), expected, atol=1e-4)


def test_jax_and_numpy_see_the_same_ground(ground, field):
    xy = places(ground, 50, seed=4).astype(np.float32)
    point = np.column_stack([xy, np.ones(len(xy))]).astype(np.float32)
    inside = jax.jit(lambda f, x: (f.height(x[:, :2]), f.clearance(x, 0.1)))(field, point)
    np.testing.assert_allclose(inside[0], field.height(xy), atol=1e-5)
    np.testing.assert_allclose(inside[1], field.clearance(point, 0.1), atol=1e-5)


def test_a_place_beyond_the_edge_has_the_height_of_the_edge():
    tilted = HeightField.of(np.array([[0.0, 1.0], [2.0, 3.0]]), np.zeros(2), 1.0)
    far = np.array([[-5.0, 0.5], [9.0, 0.5], [9.0, 9.0]])
    np.testing.assert_allclose(tilted.height(far), [1.0, 2.0, 3.0])


def test_the_flat_plane_has_the_same_interface():
    flat, xy = Terrain.flat(), jnp.ones((3, 4, 2))
    np.testing.assert_array_equal(flat.height(xy), 0.0)
    np.testing.assert_array_equal(flat.normal(xy)[..., 2], 1.0)
    centre = jnp.array([[1.0, 2.0, 0.3]])
    np.testing.assert_allclose(flat.clearance(centre, 0.1), [0.2])


def region_slopes(ground: TerrainMap, field: HeightField, region: int) -> np.ndarray:
    """Degrees of the slopes at many places of a region."""
    xy = places(ground, 20_000, seed=3)
    normal = field.normal(xy[ground.region(xy) == region])
    return np.degrees(np.arccos(np.clip(normal[:, 2], -1, 1)))


def test_regions_are_as_steep_as_the_config_says(ground, field):
    steepest = [region_slopes(ground, field, i).max() for i in range(len(REGIONS))]
    assert steepest[0] == pytest.approx(0.0, abs=0.05)
    np.testing.assert_allclose(steepest[1:], CONFIG.slope_deg, rtol=0.1)


def test_tiles_of_the_rough_half_stay_within_their_amplitude(ground):
    points = round(CONFIG.region_size_m / ground.step)
    middle = len(ground.heights) // 2
    hard_rough = ground.heights[middle + points // 2 : middle + points + 1, middle:][:, :points]
    assert 0.8 * CONFIG.rough_m[2] < np.abs(hard_rough).max() <= CONFIG.rough_m[2]
    corner = hard_rough[::2, ::2]
    between = 0.5 * (corner[:, :-1] + corner[:, 1:])
    np.testing.assert_allclose(hard_rough[::2, 1::2][:, : between.shape[1]], between, atol=1e-9)


def test_regions_meet_without_steps_in_height(ground):
    middle = len(ground.heights) // 2
    points = round(CONFIG.region_size_m / ground.step)
    for edge in (middle - points, middle, middle + points):
        np.testing.assert_array_equal(ground.heights[edge], 0.0)
        np.testing.assert_array_equal(ground.heights[:, edge], 0.0)


def test_the_seed_decides_the_ground():
    again = make_terrain(CONFIG).heights
    np.testing.assert_array_equal(again, make_terrain(CONFIG).heights)
    other = make_terrain(dataclasses.replace(CONFIG, seed=1)).heights
    assert np.abs(other - again).max() > 0.1


@pytest.mark.parametrize("region", range(4))
def test_spawn_places_lie_in_their_region(ground, region):
    xy = ground.draw_spawn(region, 500, np.random.default_rng(0))
    np.testing.assert_array_equal(ground.region(xy), region)
    ground.check_spawn(xy)


def test_half_of_the_spawn_places_are_on_slopes(ground):
    xy = ground.draw_spawn(3, 2000, np.random.default_rng(0))
    sloped = xy[:, 1] < CONFIG.region_size_m / 2
    assert 0.45 < sloped.mean() < 0.55


def test_a_spawn_outside_the_regions_is_an_error(ground):
    with pytest.raises(ConfigError, match=r"x, y = \[0\.0, 17\.0\] is outside.*-16 to 16 m"):
        ground.check_spawn(np.array([[1.0, 1.0], [0.0, 17.0]]))


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"region_size_m": -1.0}, r"terrain\.region_size_m: expected .* more than 0 .*, got -1"),
        ({"grid_step_m": 0.1}, r"terrain\.grid_step_m: expected .* from 0\.5 to 10, got 0\.1"),
        (
            {"slope_deg": (10.0, 20.0, 70.0)},
            r"terrain\.slope_deg\[2\]: expected .* from 0 to 60, got 70",
        ),
        ({"slope_deg": (20.0, 10.0, 30.0)}, r"terrain\.slope_deg: expected three values"),
        ({"rough_m": (0.1, 0.2)}, r"terrain\.rough_m: expected 3 numbers .* got 2"),
        ({"slope_block_m": 2.0}, r"terrain\.slope_block_m: expected .* from 8 to 100, got 2"),
        ({"region_size_m": 12.0}, r"terrain\.region_size_m: expected at least 2 x"),
        ({"region_size_m": 30.0}, r"terrain\.region_size_m: expected a multiple of 2 x"),
        (
            {"tile_m": 0.75, "region_size_m": 24.0},
            r"terrain\.tile_m: expected a multiple of terrain\.grid_step_m",
        ),
        ({"tile_m": float("nan")}, r"terrain\.tile_m: expected .*, got nan"),
        ({"curriculum": "fast"}, r"terrain\.curriculum: expected one of"),
        ({"drops": 0}, r"terrain\.drops: expected a whole number from 1 to 200000, got 0"),
    ],
)
def test_a_ground_that_cannot_be_built_is_an_error(changes, text):
    with pytest.raises(ConfigError, match=text):
        TerrainConfig(**changes)


def test_a_character_stands_still_on_the_field(ground):
    """Without the studs a sole has one contact a triangle, and the character falls."""
    character = load_character(PhysicsConfig(engine="native"), ground)
    xy = ground.draw_spawn(0, 8, np.random.default_rng(0))
    batch = Batch(character.model, len(xy))
    batch.qpos[:] = character.neutral_qpos
    batch.qpos[:, :2], batch.ctrl[:] = xy, character.neutral_qpos[7:]
    batch.step(nstep=240)
    assert batch.qpos[:, 2].min() > 0.9
    assert np.abs(batch.qvel).max() < 0.1


def test_the_character_on_the_field_is_the_same_body(ground):
    config = PhysicsConfig(engine="native")
    flat, uneven = load_character(config).model, load_character(config, ground).model
    for name in ("body_mass", "body_inertia", "body_pos", "jnt_range", "actuator_gainprm"):
        np.testing.assert_array_equal(getattr(flat, name), getattr(uneven, name))
