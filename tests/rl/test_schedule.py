from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from getup_jax.rl import schedule


def test_five_stages_by_hand():
    progress = jnp.asarray([0.0, 0.19, 0.2, 0.41, 0.6, 0.99, 1.0, 1.7])
    found = schedule.value(1e-4, 2e-5, 5, progress)
    expected = [1e-4, 1e-4, 8e-5, 6e-5, 4e-5, 2e-5, 2e-5, 2e-5]
    np.testing.assert_allclose(found, expected, rtol=1e-5)


def test_one_stage_is_constant():
    np.testing.assert_allclose(schedule.value(0.6, 0.3, 1, jnp.asarray([0.0, 0.5, 2.0])), 0.6)


def test_every_boundary_is_met_in_float32():
    # 50 iterations in 5 stages: the boundary products are rounded, the stage must still change.
    progress = jnp.arange(50, dtype=jnp.float32) * (1.0 / 50.0)
    found = schedule.value(0.0, 4.0, 5, progress)
    np.testing.assert_allclose(found, np.repeat(np.arange(5.0), 10))
