"""Markers become geoms of a scene."""

from __future__ import annotations

import mujoco
import numpy as np

from getup_jax.envs.composite.goals import Marker
from getup_jax.envs.composite.goals.drawing import add_markers

ARROW = Marker(np.array([1.0, 0.0, 0.5]), reach=np.array([0.0, 2.0, 0.0]), radius=0.02)
SPHERE = Marker(np.array([0.0, 1.0, 0.0]), radius=0.3, rgba=(0.1, 0.2, 0.3, 0.4))


def scene(room: int) -> mujoco.MjvScene:
    model = mujoco.MjModel.from_xml_string("<mujoco><worldbody/></mujoco>")
    return mujoco.MjvScene(model, maxgeom=room)


def test_an_arrow_points_along_its_reach_and_a_sphere_has_its_radius():
    shown = scene(5)
    add_markers(shown, [ARROW, SPHERE])
    arrow, sphere = shown.geoms[0], shown.geoms[1]
    assert (arrow.type, sphere.type) == (mujoco.mjtGeom.mjGEOM_ARROW, mujoco.mjtGeom.mjGEOM_SPHERE)
    np.testing.assert_allclose(arrow.mat[:, 2], [0, 1, 0], atol=1e-6)
    np.testing.assert_allclose(arrow.size, [0.02, 0.02, 2.0], rtol=1e-6)
    np.testing.assert_allclose(sphere.size, 0.3)
    np.testing.assert_allclose(sphere.rgba, SPHERE.rgba)


def test_a_full_scene_takes_no_more():
    shown = scene(1)
    add_markers(shown, [SPHERE, ARROW])
    assert shown.ngeom == 1
