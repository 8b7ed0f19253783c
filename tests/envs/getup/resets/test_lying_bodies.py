from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from tiny_task import CONFIG

from getup_jax.config import ConfigError, TaskConfig
from getup_jax.envs.getup.resets import lying_bodies
from getup_jax.envs.getup.resets.lying import Starts
from getup_jax.envs.getup.resets.lying_bodies import LimpBodies
from getup_jax.envs.getup.resets.rag_doll import DROPS
from getup_jax.physics.plane import Plane


@pytest.fixture
def made(monkeypatch, tmp_path):
    """What was asked for: (wanted, drop or None where bodies are pushed, first random number)."""
    calls = []

    def starts(character, wanted) -> Starts:
        region = np.repeat(np.arange(len(wanted)), wanted)
        qpos = np.tile(character.neutral_qpos, (len(region), 1))
        return Starts(qpos, np.zeros((len(region), character.model.nv)), region)

    def fall(character, place, wanted, drop, rng, log) -> Starts:
        calls.append((list(wanted), drop, rng.integers(1 << 30)))
        return starts(character, wanted)

    def knock_down(character, place, wanted, standing, rng, log) -> Starts:
        calls.append((list(wanted), None, rng.integers(1 << 30)))
        return starts(character, wanted)

    monkeypatch.setattr(lying_bodies, "fall", fall)
    monkeypatch.setattr(lying_bodies, "knock_down", knock_down)
    monkeypatch.setattr(lying_bodies, "cache_dir", lambda: tmp_path)
    return calls


def bodies(character, **changes) -> LimpBodies:
    task = dataclasses.replace(CONFIG.task, **changes)
    return LimpBodies(character, Plane(), task, 0, lambda text: None)


def test_on_the_flat_there_are_none_unless_asked(character, made):
    assert bodies(character).on_the_flat() is None
    assert not made


def test_the_pushed_ones_are_a_share_of_all(character, made):
    starts = bodies(character, limp_share=0.5, limp_drops=10, fallen_share=0.3).on_the_flat()
    assert starts is not None
    np.testing.assert_array_equal(starts.region, np.zeros(10))
    assert [(wanted, drop) for wanted, drop, _ in made] == [
        ([7, 0, 0, 0], DROPS["limp"][0]),
        ([3, 0, 0, 0], None),
    ]


def test_on_slopes_the_regions_have_as_many(character, made):
    none = Starts.none(character)
    starts = bodies(character, drop_as="paper", fallen_share=0.5).on_slopes(12, none)
    np.testing.assert_array_equal(np.bincount(starts.region), [0, 4, 4, 4])
    assert [(wanted, drop) for wanted, drop, _ in made] == [
        ([0, 2, 2, 2], DROPS["paper"][0]),
        ([0, 2, 2, 2], None),
    ]


def test_they_are_made_once_and_every_way_has_files_of_its_own(character, made, tmp_path):
    for _ in range(2):
        for drop in DROPS:
            bodies(character, limp_share=1.0, limp_drops=4, drop_as=drop).on_the_flat()
    ways = sum(map(len, DROPS.values()))
    assert len(made) == ways
    bodies(character, limp_share=1.0, limp_drops=4).on_slopes(4, Starts.none(character))
    assert len(made) == ways + 1
    assert len(list(tmp_path.glob("starts/*.npz"))) == ways + 1


@pytest.mark.parametrize("number", [6, 7])
def test_varied_ones_are_dropped_in_every_way(character, made, number):
    starts = bodies(character, limp_share=1.0, limp_drops=number, drop_as="varied").on_the_flat()
    assert starts is not None
    np.testing.assert_array_equal(starts.region, np.zeros(number))
    assert [(sum(wanted), drop) for wanted, drop, _ in made] == [
        (number - 3, DROPS["any"][0]),
        (3, DROPS["paper"][0]),
    ]


def test_another_number_on_the_flat_is_of_other_bodies(character, made):
    for count in (4, 5):
        bodies(character, limp_share=1.0, limp_drops=count).on_the_flat()
    assert made[0][2] != made[1][2]


@pytest.mark.parametrize(
    ("name", "value"),
    [("limp_share", 1.5), ("fallen_share", -0.1), ("drop_as", "doll"), ("limp_drops", 0)],
)
def test_settings_that_make_no_sense_are_named(name, value):
    with pytest.raises(ConfigError, match=rf"task\.{name}: expected .*, got"):
        TaskConfig(**{name: value})
