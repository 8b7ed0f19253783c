from __future__ import annotations

import re

import mujoco
import pytest

from getup_jax.config import ConfigError, PhysicsConfig
from getup_jax.core.resources import asset_path
from getup_jax.physics.character import load_character
from getup_jax.physics.requirements import GEOMS, LINKS

OWN = asset_path("humanoid49.xml").read_text()


def load(tmp_path, text):
    file = tmp_path / "own.xml"
    file.write_text(text)
    return load_character(PhysicsConfig(character=str(file)))


def test_a_copy_under_another_name_is_the_same_character(tmp_path, character):
    copy = load(tmp_path, OWN.replace('model="humanoid49"', 'model="mine"'))
    assert copy.link_names == character.link_names
    assert copy.joint_names == character.joint_names


@pytest.mark.parametrize("shipped", ["humanoid49", "humanoid28"])
def test_shipped_characters_have_all_that_is_needed(shipped):
    model = load_character(PhysicsConfig(character=shipped)).model
    assert {model.body(i).name for i in range(model.nbody)} >= set(LINKS)
    assert {model.geom(i).name for i in range(model.ngeom)} >= GEOMS.keys()


def without_joint_names(text):
    """Hinges called as an exporter numbers them; actuators follow."""
    return re.sub(r'"(\w+)_(flex|abd|twist)"', r'"\1\2"', text)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text.replace('name="head" type', 'name="skull" type'), "lacks geom 'head' "),
        (lambda text: text.replace('<body name="shin_l"', '<body name="calf_l"'), "body 'shin_l'"),
        (lambda text: text.replace('geom name="foot_r"', 'geom name="sole_r"'), "geom 'foot_r' "),
        (
            lambda text: text.replace('geom name="floor"', 'geom name="ground"'),
            "lacks geom 'floor'",
        ),
        (without_joint_names, r"joint '\w+' of body '\w+': expected the name \w+_flex or"),
        (lambda text: re.sub(r'(<joint [^>]*?) range="[^"]*"', r"\1", text), "expected a range"),
        (lambda text: re.sub(r"<position (name)", r"<motor \1", text), "a position servo"),
        (lambda text: text.replace("<freejoint", "<light"), "own.xml: "),
        (lambda text: text[:4000], "not a valid MJCF file: "),
        (lambda text: "no xml", "not a valid MJCF file: "),
        (lambda text: text.replace('key name="neutral"', 'key name="up"'), "named 'neutral'"),
    ],
)
def test_what_a_file_lacks_is_said_in_one_line_when_it_is_loaded(tmp_path, change, message):
    text = change(OWN)
    assert text != OWN
    with pytest.raises(ConfigError, match=message) as caught:
        load(tmp_path, text)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith("physics.character: ")


def test_all_that_is_missing_is_listed_at_once(tmp_path):
    text = OWN.replace('body name="hand_', 'body name="fist_').replace('"foot_l"', '"paw_l"')
    with pytest.raises(ConfigError) as caught:
        load(tmp_path, text)
    for name in ("body 'foot_l'", "body 'hand_l'", "body 'hand_r'", "geom 'foot_l' (a box)"):
        assert name in str(caught.value)
    assert "docs/character.md" in str(caught.value)


@pytest.mark.parametrize(("by", "text"), [(-0.1, "at -0.10 m; raise"), (0.2, "at 0.20 m; lower")])
def test_a_keyframe_that_does_not_stand_on_the_floor_is_warned_about(tmp_path, character, by, text):
    x, y, z, *rest = character.neutral_qpos
    file = tmp_path / "sunk.xml"
    spec = mujoco.MjSpec.from_string(OWN)
    spec.key("neutral").qpos = [x, y, z + by, *rest]
    spec.compile()
    file.write_text(spec.to_xml())
    with pytest.warns(UserWarning, match=f"'neutral': expected both soles on z = 0, .* {text}"):
        load_character(PhysicsConfig(character=str(file)))
