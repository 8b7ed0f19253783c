from __future__ import annotations

import dataclasses

import numpy as np
from tiny_task import getups, supine

from getup_jax.envs.getup.resets.style_matching import fits, least_used


def test_a_body_fits_the_styles_whose_first_torso_angles_are_near(character):
    clip, curve = getups(character)
    tilted = dataclasses.replace(curve, points=curve.points + np.array([0.5, 0.0, 0.4]))
    bodies = np.stack([supine(character), character.neutral_qpos])
    found = fits([clip, tilted], bodies, character, 0.52)
    np.testing.assert_array_equal(found, [[True, True], [False, False]])
    np.testing.assert_array_equal(fits([clip, tilted], bodies, character, 0.3)[0], [True, False])


def test_styles_share_the_starts_as_little_as_possible():
    used, rng = np.zeros(10, int), np.random.default_rng(0)
    own = np.arange(10) >= 4
    first = least_used(own, used, 3, rng)
    second = least_used(own, used, 3, rng)
    assert sorted([*first, *second]) == list(range(4, 10))
    least_used(own, used, 7, rng)  # more than there are: one comes twice
    assert sorted(used) == [0, 0, 0, 0, 2, 2, 2, 2, 2, 3]
