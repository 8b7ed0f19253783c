from __future__ import annotations

import jax.numpy as jnp
from numpy.testing import assert_allclose

from getup_jax.rl import weight_average


def _after(updates: int, samples: int, window: float = 1e6) -> float:
    """The average of actors 0, 1, 2, ... after so many."""
    value = {"w": jnp.zeros(())}
    for n in range(updates):
        actor = {"w": jnp.asarray(float(n))}
        value = weight_average.update(value, actor, jnp.asarray(n), samples, window)
    return float(value["w"])


def test_the_first_update_replaces_what_was_there():
    before, actor = {"w": jnp.asarray(7.0)}, {"w": jnp.asarray(1.0)}
    assert float(weight_average.update(before, actor, jnp.asarray(0), 100, 1e6)["w"]) == 1.0


def test_a_young_run_averages_over_its_last_tenth():
    # weights of polynomial decay: the mean age is updates / (1 / share + 1)
    age = 1000 - 1 - _after(1000, samples=1)
    assert_allclose(age, 1000 / 11, rtol=0.1)


def test_a_long_run_averages_over_the_window():
    # an exponential average with fraction f is 1 / f - 1 updates old
    age = 4000 - 1 - _after(4000, samples=20_000)
    assert_allclose(age, 1e6 / 20_000 - 1, rtol=0.02)


def test_without_a_window_the_newest_weights_are_the_average():
    assert _after(50, samples=1, window=0.0) == 49.0
