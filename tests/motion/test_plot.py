from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from motion_samples import PRONE, SUPINE, getup_clip

from getup_jax.motion.clips import GetUp, MotionError
from getup_jax.motion.getup.plot import class_curves, plot_strategies, strategy_curves
from getup_jax.motion.getup.strategies import OTHER


def getup(character, points, lying=SUPINE, clip=True):
    motion = getup_clip(character, lying, still_s=0.3, rise_s=0.6)
    return GetUp("own", 2.0, points, motion if clip else None, "by hand")


def leaning(side_deg):
    """Control points of constant curves: 1 m, the given side angle, 90 degrees."""
    return np.tile([1.0, np.radians(side_deg), np.pi / 2], (9, 1))


def test_curves_of_a_class_are_in_metres_and_degrees(character):
    (values,) = class_curves([getup(character, leaning(60))]).values()
    np.testing.assert_allclose(values, np.tile([1.0, 60.0, 90.0], (1, 101, 1)), atol=1e-3)


def test_strategies_are_told_from_the_motion_and_turn_to_one_side(character):
    both = [getup(character, leaning(side), lying) for side, lying in ((60, SUPINE), (110, PRONE))]
    drawn = getup(character, leaning(60), clip=False)
    classes = strategy_curves([*both, drawn], character)
    assert list(classes) == [OTHER]  # a board that stands up, whatever it is called
    np.testing.assert_allclose(classes[OTHER][..., 1].mean(axis=1), [120, 110], atol=1e-3)


def test_nothing_to_draw(character, tmp_path):
    drawn = dataclasses.replace(getup(character, leaning(60)), clip=None)
    with pytest.raises(MotionError, match="no get-ups with a motion"):
        plot_strategies([drawn], character, tmp_path / "none.png")
