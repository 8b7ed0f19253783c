from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from getup_jax.config import PhysicsConfig, TerrainConfig
from getup_jax.config.load import load_saved_config
from getup_jax.core.resources import asset_path
from getup_jax.envs.composite.build import equipment_of
from getup_jax.physics.body_digest import KEY, body_digest, warn_if_other
from getup_jax.physics.character import load_character
from getup_jax.physics.props import Equipment
from getup_jax.physics.terrain_map import make_terrain
from getup_jax.runtime.checkpoint import shipped_policies

OWN = asset_path("humanoid49.xml").read_text()


def digest(**settings):
    return body_digest(load_character(PhysicsConfig(**settings)).model)


def written(tmp_path, text, name="own.xml"):
    (tmp_path / name).write_text(text)
    return str(tmp_path / name)


def differ(one, other):
    assert one.keys() == other.keys()
    return {group for group in one if one[group] != other[group]}


def test_ground_and_names_of_files_are_no_part_of_the_body(tmp_path):
    own = digest()
    ground = make_terrain(TerrainConfig(region_size_m=16.0, slope_block_m=8.0))
    assert body_digest(load_character(PhysicsConfig(), ground).model) == own
    assert digest(character=written(tmp_path, OWN, "other.xml")) == own
    assert digest(control_hz=20, solver="newton", iterations=30) == own
    paler = re.sub(r'rgba="[^"]*"', 'rgba="1 1 1 1"', OWN).replace('pos="0 0 0.8', 'pos="0 0 0.9')
    assert digest(character=written(tmp_path, paler)) == own


@pytest.mark.parametrize(
    ("settings", "groups"),
    [
        ({"gain_scale": 2.0}, {"servos"}),
        ({"torque_scale": 0.5}, {"servos"}),
        ({"armature": 0.2}, {"damping"}),
        ({"damping": 0.5}, {"damping"}),
    ],
)
def test_settings_of_the_body_show(settings, groups):
    assert differ(digest(), digest(**settings)) == groups


def longer_shins(text):
    before, shin = text.split('<body name="foot_l" pos="0 0 -', 1)
    length, rest = shin.split('"', 1)
    return f'{before}<body name="foot_l" pos="0 0 -{float(length) + 0.06:.4f}"{rest}'


@pytest.mark.filterwarnings("ignore:.*expected both soles on z = 0")
@pytest.mark.parametrize(
    ("change", "groups"),
    [
        (longer_shins, {"lengths"}),
        (lambda text: text.replace('mass="', 'mass="1', 1), {"masses"}),
        (lambda text: re.sub(r'(geom name="hand_l"[^>]*size="0.)', r"\g<1>1", text), {"shapes"}),
    ],
)
def test_bodies_that_differ_in_the_file_show(tmp_path, change, groups):
    text = change(OWN)
    assert text != OWN
    assert groups <= differ(digest(), digest(character=written(tmp_path, text)))


def test_a_racket_is_part_of_the_body_and_a_ball_is_not():
    config = PhysicsConfig(character="humanoid28")
    bare, racket = (
        body_digest(load_character(config, equipment=equipment).model)
        for equipment in (None, Equipment(racket=True))
    )
    assert "masses" in differ(bare, racket)


def test_a_warning_says_what_is_other():
    lines: list[str] = []
    own, other = digest(), digest(gain_scale=2.0, damping=0.5)
    warn_if_other(Path("runs/x"), {KEY: own}, other, lines.append)
    (line,) = lines
    assert line.startswith("warning: runs/x: was trained on a body with other damping, servos;")
    assert "\n" not in line


@pytest.mark.parametrize(("metadata", "known"), [({}, True), ({KEY: None}, True), ("own", False)])
def test_the_same_body_and_unknown_ones_give_no_warning(metadata, known):
    lines: list[str] = []
    own = digest()
    metadata = {KEY: own} if metadata == "own" else metadata
    warn_if_other(Path("x"), metadata, own if known else None, lines.append)
    warn_if_other(Path("x"), {KEY: dict(own)}, own, lines.append)
    assert lines == []


@pytest.mark.parametrize("name", shipped_policies())
def test_shipped_policies_know_the_body_of_their_settings(name):
    folder = asset_path("checkpoints", name)
    config = load_saved_config(folder / "config.yaml")
    equipment = equipment_of(config.composite.goals) if config.composite_motion else None
    body = body_digest(load_character(config.physics, equipment=equipment).model)
    assert json.loads((folder / "checkpoint.json").read_text())["metadata"][KEY] == body
