"""Model cards of composite motion; those of getting up are tested with the evaluation."""

from __future__ import annotations

import json

import pytest

from getup_jax.config import ConfigError
from getup_jax.core.resources import asset_path
from getup_jax.release.card import _conditions, gain_line, weak_curves
from getup_jax.release.export import CARD, export
from getup_jax.runtime.checkpoint import load_policy, shipped_policies

WALK = asset_path("checkpoints", "walk")


@pytest.fixture
def result():
    """What `getup-eval --json` writes of it, with numbers that are easy to find."""
    loaded = load_policy(WALK)
    return {
        "goals": {"target_location": {"reward": 0.625, "success": 0.875}},
        "imitation_error_m": {"body": {"mean": 0.0324, "std": 0.0111, "travel": 1.04}},
        "meta_weight": {},
        "ratio": 1.0,
        "fall_share": 0.25,
        "episodes": 8,
        "policy": {"seed": loaded.config.seed, **loaded.metadata},
    }


def test_a_card_of_composite_motion_has_its_groups_and_goals(tmp_path, result):
    file = tmp_path / "eval.json"
    file.write_text(json.dumps(result))
    card = (export(WALK, tmp_path / "policy", [file]) / CARD).read_text()
    for expected in (
        "| clips | body: walk |",
        "| goals | target_location |",
        "| body | 0.032 ± 0.011 | 1.04 |",
        "| target_location | 0.625 | 88% |",
        "25% of the episodes have a fall.",
    ):
        assert expected in card
    assert "lying" not in card
    assert "not been measured" not in card


def test_goals_without_attempts_and_several_groups(tmp_path, result):
    result["goals"]["target_location"]["success"] = None
    result["imitation_error_m"]["arm"] = {"mean": 0.01, "std": 0.0, "travel": 0.5}
    result["ratio"] = 3.24
    file = tmp_path / "eval.json"
    file.write_text(json.dumps(result))
    card = (export(WALK, tmp_path / "policy", [file]) / CARD).read_text()
    assert "| target_location | 0.625 | - |" in card
    assert "the largest error is 3.2 times the smallest" in card


def test_an_evaluation_of_another_task_is_refused(tmp_path, result):
    del result["imitation_error_m"]
    file = tmp_path / "eval.json"
    file.write_text(json.dumps(result))
    with pytest.raises(ConfigError, match=r"--eval: .*eval\.json: is of another task"):
        export(WALK, tmp_path / "policy", [file])
    assert not (tmp_path / "policy").exists()


def test_a_curve_that_fails_is_named_once_with_its_worst_evaluation():
    def evaluated(**rates: float) -> dict:
        curves = {name: {"success": rate} for name, rate in rates.items()}
        return {"conditions": {"start": "lying", "blend": None}, "per_curve": curves}

    lines = weak_curves([evaluated(a=0.9, b=0.5, c=1.0), evaluated(a=0.7, b=0.2, c=0.8)])
    assert lines == ["Curves that succeed in less than 80%: b (20%), a (70%)."]
    many = weak_curves([evaluated(**{f"c{i:02}": i / 100 for i in range(30)}, good=1.0)])
    assert many[0].startswith(
        "Curves that succeed in less than 80% in one of these evaluations: 30 of 31. The worst: "
        "c00 (0%), c01 (1%),"
    )
    assert many[0].count("%)") == 8
    assert weak_curves([evaluated(a=0.8)]) == []
    others = evaluated(a=0.1)  # motions that it was not trained on are not its limits
    others["conditions"]["motions"] = "recorded.yaml"
    assert weak_curves([others]) == []


def test_a_card_says_what_is_done_of_edits_and_which_curves_were_trained(tmp_path):
    found = {
        "height": {"gain": 0.471, "correlation": 0.37},
        "side_angle": {"gain": 0.5, "correlation": None},
    }
    assert gain_line({"control_gain": found})[-1] == (
        "Done of what small edits of the curves ask for (correlation): height 0.47 (0.37), "
        "side angle 0.50 (-)."
    )
    assert gain_line({}) == []
    for name, expected in (("getup", "curves drawn around"), ("flat", "the curves of its styles")):
        card = (export(asset_path("checkpoints", name), tmp_path / name) / CARD).read_text()
        assert f"Trained on {expected}" in card


def test_a_card_says_on_which_motions_curves_and_ground_a_policy_was_tried():
    plain = {
        "start": "lying",
        "seed": 0,
        "engine": "native",
        "start_noise_rad": 0.0,
        "duration_scale": [1.0, 1.0],
        "blend": None,
        "push_ns": None,
        "stand_time_s": 3.0,
    }
    other = {
        "motions": "there/recorded.yaml",
        "curves": ["here/a.json", "b.json"],
        "early_termination": False,
        "ground": {"heights": "far/hills.png", "region_size_m": 24.0, "height_m": 2.0},
    }
    own = _conditions(plain)
    assert "motions" not in own
    assert "curves" not in own
    assert "early" not in own
    said = _conditions(plain | other)
    for part in (
        "motions of recorded.yaml",
        "curves of a.json, b.json",
        "no early ends",
        "ground of hills.png",
    ):
        assert part in said
    assert "there/" not in said


@pytest.mark.parametrize("name", shipped_policies())
def test_the_card_of_a_shipped_policy_says_its_name(name):
    text = (asset_path("checkpoints", name) / CARD).read_text()
    assert text.startswith(f"# Policy `{name}`\n")
    assert f"getup-eval --ckpt {name}\n" in text
