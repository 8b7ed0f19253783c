from __future__ import annotations

import numpy as np

from getup_jax.physics.plane import Plane


def test_the_plane_is_even_and_has_one_region():
    place, xy = Plane(), np.array([[0.0, 0.0], [-30.0, 4.0], [0.3, 0.9]])
    field = place.field()
    np.testing.assert_array_equal(field.height(xy), 0.0)
    np.testing.assert_array_equal(field.normal(xy), np.tile([0.0, 0.0, 1.0], (3, 1)))
    np.testing.assert_array_equal(place.region(xy), 0)
    spawn = place.draw_spawn(0, 5, np.random.default_rng(0))
    np.testing.assert_array_equal(spawn, np.zeros((5, 2)))
