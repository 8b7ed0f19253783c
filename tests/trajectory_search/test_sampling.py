from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from scipy.spatial.transform import Rotation

from getup_jax.trajectory_search.finder import _ancestors
from getup_jax.trajectory_search.sampling import MOST_CHILDREN, Sampler, distance


def test_distance_does_not_see_place_and_heading():
    links = np.random.default_rng(0).normal(size=(19, 3))
    turned = Rotation.from_euler("z", 2.0).apply(links) + np.array([3.0, -1.0, 0.0])
    assert distance(jnp.asarray(turned), jnp.asarray(links)) < 1e-5


def test_distance_sees_height_and_pose():
    links = np.random.default_rng(0).normal(size=(19, 3))
    lifted = links + np.array([0.0, 0.0, 0.25])
    np.testing.assert_allclose(distance(jnp.asarray(lifted), jnp.asarray(links)), 0.25, atol=1e-5)
    tilted = Rotation.from_euler("x", 0.5).apply(links)
    assert distance(jnp.asarray(tilted), jnp.asarray(links)) > 0.1


def test_no_parent_has_more_than_its_share_of_children_that_go_on():
    sampler = Sampler(env=None, size=8, children=64)  # type: ignore[arg-type]
    score = jnp.arange(64.0).reshape(8, 8).T.reshape(-1)  # the children of parent 0 are best
    chosen = np.asarray(sampler.fittest(score))
    parents = chosen % 8
    assert np.bincount(parents, minlength=8).max() == MOST_CHILDREN
    np.testing.assert_array_equal(parents, np.repeat([0, 1], MOST_CHILDREN))


def test_one_child_of_every_parent_does_not_change(built):
    sampler = Sampler(built.environment, size=4, children=16)
    noise = np.asarray(sampler.noise(0.3, jax.random.PRNGKey(0)))
    assert (noise[:4] == 0.0).all()
    assert (np.abs(noise[4:]).max(axis=1) > 0.0).all()


def test_ancestors_are_those_whose_descendants_live_on():
    parents = [np.array([0, 0, 2, 3]), np.array([1, 1, 2, 2]), np.array([0, 0, 0, 3])]
    # the last population came from 0 and 3 of the third, these from 1 and 2, these from 0 and 2
    np.testing.assert_array_equal(_ancestors(parents), [0, 2])
