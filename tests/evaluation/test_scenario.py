from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from tiny_task import getups

from getup_jax.config import Config, ConfigError, PhysicsConfig
from getup_jax.config.load import load_config
from getup_jax.envs.getup.resets.pool import angle_gap
from getup_jax.evaluation.scenario import Scenario, blended, make_plan, of_config, orientation
from getup_jax.motion.clips import Clip, GetUp
from getup_jax.motion.io.bvh_writer import write_bvh
from getup_jax.motion.retarget.body import record
from getup_jax.physics.character import CharacterSpec, load_character

MATCH_RAD = 0.52


@pytest.fixture(scope="module")
def character() -> CharacterSpec:
    return load_character(PhysicsConfig())


@pytest.fixture(scope="module")
def styles(character) -> list[GetUp]:
    """`clip` and `curve`, supine and alike; `belly`, prone."""
    clip, curve = getups(character)
    curve = dataclasses.replace(curve, points=curve.points + np.array([0.1, 0.2, 0.0]))
    belly = dataclasses.replace(curve, name="belly", points=clip.points * [1, 1, 0] + [0, 0, np.pi])
    return [clip, curve, belly]


# The plan.


def test_styles_come_in_turn_each_with_one_start_after_the_other():
    plan = make_plan(Scenario(), 7, num_styles=2, rows=3)
    assert plan.getup.tolist() == [0, 1, 0, 1, 0, 1, 0]
    assert plan.row.tolist() == [0, 0, 1, 1, 2, 2, 0]
    assert (plan.duration_scale == 1.0).all()
    assert not plan.impulse.any()


def test_durations_and_pushes_are_random_and_repeat_with_the_seed():
    conditions = Scenario(duration_scale=(0.8, 1.2), push_ns=20.0, seed=3)
    plan, again = (make_plan(conditions, 2000, 2, 3) for _ in range(2))
    assert 0.8 <= plan.duration_scale.min() < 0.81
    assert 1.19 < plan.duration_scale.max() <= 1.2
    np.testing.assert_allclose(np.linalg.norm(plan.impulse, axis=-1), 20.0)
    assert (plan.impulse[:, 2] == 0).all()
    assert np.abs(plan.impulse.mean(axis=0)).max() < 1.5  # no direction is preferred
    np.testing.assert_array_equal(plan.impulse, again.impulse)
    other = make_plan(dataclasses.replace(conditions, seed=4), 2000, 2, 3)
    assert (plan.duration_scale != other.duration_scale).any()


def test_a_push_needs_a_standing_phase_that_is_long_enough():
    short = load_config(None, ["task.stand_time_s=1.0"])
    with pytest.raises(ConfigError, match=r"--push: .* lasts 1 s; give a longer --stand-time"):
        Scenario(push_ns=20.0).check(short)
    Scenario(push_ns=20.0).check(Config())
    Scenario().check(short)


# Mixtures.


def test_half_and_half(styles, character):
    (mixed,) = blended(styles, character, MATCH_RAD, Scenario(blend="half"))
    first, second = styles[:2]
    assert mixed.name == "50% clip + 50% curve"
    assert mixed.duration == pytest.approx((first.duration + second.duration) / 2)
    np.testing.assert_allclose(mixed.points, (first.points + second.points) / 2)
    assert mixed.clip is first.clip
    assert angle_gap(mixed.clip.qpos[0], mixed, character) <= MATCH_RAD


def test_random_weights_are_named_and_differ_with_the_seed(styles, character):
    weights = set()
    for seed in range(4):
        conditions = Scenario(blend="random", seed=seed)
        (mixed,) = blended(styles, character, MATCH_RAD, conditions)
        weight = (mixed.duration - styles[1].duration) / (styles[0].duration - styles[1].duration)
        expected = weight * styles[0].points + (1 - weight) * styles[1].points
        np.testing.assert_allclose(mixed.points, expected)
        assert mixed.name.startswith(f"{weight:.0%} clip + ")
        weights.add(weight)
    assert len(weights) == 4
    assert all(0 <= weight <= 1 for weight in weights)


def test_two_curves_alone_start_from_a_motion_like_them(styles, character):
    clip, curve, _ = styles
    other = dataclasses.replace(curve, name="other")
    mixed = {x.name: x for x in blended([clip, curve, other], character, MATCH_RAD, Scenario())}
    assert all(x.clip is clip.clip for x in mixed.values())
    assert len(mixed) == 3


def test_curves_that_do_not_start_alike_are_not_mixed(styles, character):
    with pytest.raises(ConfigError, match="--blend: no two of the 2 curves start within"):
        blended([styles[0], styles[2]], character, MATCH_RAD, Scenario(blend="half"))


@pytest.mark.parametrize(
    ("front", "expected"), [(0.3, "supine"), (2.9, "prone"), (1.2, "side"), (1.9, "side")]
)
def test_orientation_is_that_of_the_first_front_angle(front, expected):
    points = np.zeros((9, 3))
    points[0, 2] = front
    assert orientation(GetUp("a", 1.0, points)) == expected


def test_the_motions_of_another_config_take_the_place_of_the_trained_ones(
    styles, character, tmp_path
):
    config = tmp_path / "other.yaml"
    config.write_text("motion: {curves: [prone_half_kneel_left, roll_over_quadruped@5.1]}\n")
    found = of_config(str(config), styles, character)
    assert [g.name for g in found] == ["prone_half_kneel_left", "roll_over_quadruped@5.1"]
    config.write_text("motions: {}\n")
    with pytest.raises(ConfigError, match="motions"):
        of_config(str(config), styles, character)


def test_a_motion_file_takes_their_place_too(styles, character, tmp_path, monkeypatch):
    monkeypatch.setenv("GETUP_JAX_CACHE", str(tmp_path / "cache"))
    qpos = np.tile(character.neutral_qpos, (70, 1))
    qpos[:30, 2:7] = [0.12, np.sqrt(0.5), 0, -np.sqrt(0.5), 0]  # on its back, then upright
    write_bvh(record(Clip("take", 30.0, qpos), character), tmp_path / "take.bvh")
    (found,) = of_config(str(tmp_path / "take.bvh"), styles, character)
    assert found.name.startswith("take:")
