from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from tiny_composite import COMPOSITE, CONFIG

from getup_jax.config import ConfigError
from getup_jax.evaluation import meta_weights_plot
from getup_jax.evaluation.composite_rollout import CompositeEpisodes
from getup_jax.physics.character import load_character


@pytest.fixture(scope="module")
def character():
    return load_character(CONFIG.physics)


def test_every_hinge_is_in_one_part(character):
    found = meta_weights_plot.parts(character)
    assert list(found) == ["left arm", "left leg", "right arm", "right leg", "trunk"]
    assert_allclose(np.sum(list(found.values()), axis=0), 1.0)
    assert found["right leg"][character.joint("shin_r_flex")]
    assert found["left arm"].sum() == found["right arm"].sum() == 4


def test_density_is_a_density():
    edges, value = meta_weights_plot.density(np.array([[0.01, 0.26], [0.26, 0.99]]))
    assert_allclose(np.sum(value * np.diff(edges)), 1.0)
    assert_allclose(value[np.searchsorted(edges, 0.26) - 1], 0.5 * meta_weights_plot.BINS)


def test_links_take_the_colour_of_their_hinges(character):
    weight = np.zeros(28)
    weight[character.joint("shin_l_flex")] = 1.0
    model = meta_weights_plot.coloured(character, weight, lambda w: (w, 0.0, 1.0 - w, 1.0))
    shin = model.geom_bodyid == character.link("shin_l") + 1
    thigh = model.geom_bodyid == character.link("thigh_l") + 1
    assert_allclose(model.geom_rgba[shin], [[1.0, 0.0, 0.0, 1.0]] * shin.sum())
    assert_allclose(model.geom_rgba[thigh], [[0.0, 0.0, 1.0, 1.0]] * thigh.sum())
    assert not np.allclose(character.model.geom_rgba[shin], [1.0, 0.0, 0.0, 1.0])


@pytest.mark.filterwarnings("ignore:--plot. without pictures")
def test_the_plot_is_drawn(character, tmp_path):
    pytest.importorskip("matplotlib")
    count = len(character.link_names)
    episodes = CompositeEpisodes(
        np.zeros((1, 9, count, 3)),
        np.zeros((1, 9, count, 4)),
        np.tile(character.neutral_qpos, (1, 9, 1)),
        np.zeros((1, 9), bool),
        np.zeros((1, 9, 0)),
        np.zeros((1, 0)),
        meta_weight=np.random.default_rng(0).uniform(size=(1, 9, 28)),
    )
    meta_weights_plot.plot_weights(tmp_path / "w.png", character, episodes)
    assert (tmp_path / "w.png").stat().st_size > 10_000


def test_a_policy_without_a_meta_policy_is_refused():
    with pytest.raises(ConfigError, match=r"--plot: .*this policy has none.*composite\.meta"):
        meta_weights_plot.check(COMPOSITE)
