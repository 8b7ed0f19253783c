from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import yaml

from getup_jax.config import MotionConfig, PhysicsConfig
from getup_jax.core.resources import asset_path
from getup_jax.motion import library
from getup_jax.motion.clips import Clip, GetUp, MotionError
from getup_jax.motion.io import curve_file
from getup_jax.motion.io.curve_file import dump, is_name, parse_text, read_curve_file
from getup_jax.physics.character import load_character

TEXT = asset_path("curves", "prone_push_up_kneel.yaml").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def character():
    return load_character(PhysicsConfig())


def changed(**values) -> str:
    return yaml.safe_dump({**yaml.safe_load(TEXT), **values})


def test_a_file_is_read_in_its_own_units_and_makes_a_get_up_a_duration():
    curve = parse_text(TEXT, "file")
    assert curve.values[0].tolist() == [0.11, 90.0, 179.0]
    first, *_, last = curve.getups()
    assert (first.name, last.name, last.duration) == (
        "prone_push_up_kneel@2.5",
        "prone_push_up_kneel@7.6",
        7.6,
    )
    np.testing.assert_allclose(first.points[0], [0.11, np.pi / 2, np.radians(179.0)])
    assert first.clip is None


def test_what_is_written_reads_back_to_the_last_bit(tmp_path):
    curve = parse_text(changed(height=[0.1 + 1e-16 * i + i / 7 for i in range(9)]), "file")
    curve = dataclasses.replace(curve, pose=np.r_[0.1, 0.2, 1 / 3, 1.0, np.zeros(52)])
    path = tmp_path / "any name.yaml"
    path.write_text(dump(curve), encoding="utf-8")
    again = read_curve_file(path)
    assert again.plain() == curve.plain()
    assert again.values.tobytes() == curve.values.tobytes()


def test_a_file_may_say_where_on_irregular_ground_it_was_drawn():
    curve = parse_text(changed(region="hard", place=3), "file")
    assert curve.ground == ("hard", 3)
    assert parse_text(dump(curve), "file").ground == ("hard", 3)
    assert parse_text(TEXT, "file").ground is None


def test_starts_are_motions_their_mirror_images_or_a_pose_of_the_file(character):
    pose = character.neutral_qpos.copy()
    pose[7 + character.joint("thigh_l_flex")] = 0.5
    clips = {"prone_quadruped_squat": Clip("clip", 30.0, pose[None])}
    plain = parse_text(TEXT, "file")
    assert plain.start_clip(clips, character) is clips["prone_quadruped_squat"]
    mirrored = parse_text(changed(start="mirrored prone_quadruped_squat"), "file")
    turned = mirrored.start_clip(clips, character).qpos[0]
    assert turned[7 + character.joint("thigh_r_flex")] == 0.5
    assert turned[7 + character.joint("thigh_l_flex")] != 0.5
    own = parse_text(changed(start="elsewhere", pose=pose.tolist()), "file")
    np.testing.assert_array_equal(own.start_clip({}, character).qpos, [pose, pose])
    with pytest.raises(MotionError, match="start: expected one of other, got 'prone_quad"):
        plain.start_clip({"other": clips["prone_quadruped_squat"]}, character)
    short = parse_text(changed(pose=pose[:20].tolist()), "file")
    with pytest.raises(MotionError, match="pose: expected 56 numbers, got 20"):
        short.start_clip(clips, character)


NINE = [0.5] * 9


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected the keys name, strategy"),
        ("- 1", "expected the keys"),
        ("1: 2\nx: 3", "expected the keys"),
        ("a: [b", "not a curve file"),
        ("\x00\x01\xff", "not a curve file"),
        ("[" * 5000, "line 1: not a curve file: nested more than 40 deep"),
        ("{a: " * 5000, "nested more than 40 deep"),
        ("- " * 5000, "nested more than 40 deep"),
        ("a: !!int ''", "line 1: not a curve file: '' cannot be read as int"),
        ("a: 1\nb: !!float x", "line 2: not a curve file: 'x' cannot be read as float"),
        ("a: 2020-13-45", "line 1: not a curve file: '2020-13-45' cannot be read as timestamp"),
        (f"a: {'1' * 5000}", "line 1: not a curve file: .* cannot be read as int"),
        (f"a: !{'a' * 5000} x", "could not determine a constructor"),
        (changed(height="HERE").replace("HERE", f"[0x{'f' * 5000}]"), "got a number of thousands"),
        (
            changed(durations="HERE").replace("HERE", f"[{'1' * 400}]"),
            "durations: expected numbers",
        ),
        (changed(name="HERE").replace("HERE", "1:" * 3000 + "1"), "name: expected up to 80"),
        ("\ud800", "not a curve file: not text"),
        ("x: " + "y" * 70_000, "expected at most 64000 bytes"),
        (changed(extra=1), "expected the keys"),
        (changed(name="../../etc/passwd"), "name: expected up to 80"),
        (changed(name=""), "name: expected up to 80"),
        (changed(name=5), "name: expected up to 80"),
        (changed(height=NINE[:8]), "height: expected 9 numbers"),
        (changed(height=[*NINE[:8], 9.0]), "height: expected numbers from -0.5 to 2.5, got 9.0"),
        (changed(height=[*NINE[:8], float("nan")]), "height: expected numbers"),
        (changed(height=[*NINE[:8], True]), "height: expected numbers"),
        (changed(height=[*NINE[:8], "1"]), "height: expected numbers"),
        (changed(height="high"), "height: expected numbers"),
        (changed(front_angle=[*NINE[:8], 271]), "front_angle: expected numbers from -90 to 270"),
        (changed(durations=[0.1]), "durations: expected numbers from 0.5 to 20"),
        (changed(durations=[]), "durations: expected 1 to 16 numbers"),
        (changed(pose=[0.0] * 56), "pose: expected a root position, a unit quaternion"),
        (changed(pose=[1.0]), "pose: expected a root position"),
        (changed(region="moon", place=1), "region: expected one of flat, easy, medium, hard, got"),
        (changed(region=["hard"], place=1), "region: expected one of"),
        (changed(region="hard"), "place: expected a whole number from 1 to 10000, got None"),
        (changed(region="hard", place=0), "place: expected a whole number"),
        (changed(place=2), "region: expected one of flat"),
    ],
)
def test_what_is_no_curve_file_is_refused_with_a_reason(text, message):
    with pytest.raises(MotionError, match=message) as caught:
        parse_text(text, "bad.yaml")
    assert str(caught.value).startswith("bad.yaml")
    assert len(str(caught.value)) < 400


def test_nested_aliases_do_not_blow_up_the_message():
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 12)]
    with pytest.raises(MotionError, match="expected the keys"):
        parse_text("\n".join(lines), "bomb.yaml")
    bomb = yaml.safe_load("\n".join(lines))["a11"]
    with pytest.raises(MotionError, match="height: expected") as caught:
        curve_file.parse({**yaml.safe_load(TEXT), "height": bomb}, "bomb.yaml")
    assert len(str(caught.value)) < 400


def test_a_missing_file_is_an_error_of_the_user(tmp_path):
    with pytest.raises(MotionError, match=r"no\.yaml: cannot be read"):
        read_curve_file(tmp_path / "no.yaml")


@pytest.mark.parametrize(
    ("name", "size"),
    [
        ("take.bvh", 10),
        ("take.BVH", 90_000),
        ("clip.npz", 10),
        ("take.amc", 10),
        ("a.json", 90_000),
    ],
)
def test_a_motion_file_points_to_the_option_for_motions(tmp_path, name, size):
    file = tmp_path / name
    file.write_bytes(b"x" * size)
    with pytest.raises(MotionError, match=rf"{name}: expected a curve file .* --motions {file}"):
        read_curve_file(file)


def test_a_large_file_that_may_be_a_curve_is_too_large(tmp_path):
    (tmp_path / "large.yaml").write_text("x" * 90_000)
    with pytest.raises(MotionError, match=r"large\.yaml: expected at most 64000 bytes"):
        read_curve_file(tmp_path / "large.yaml")


def test_a_config_takes_a_curve_file_as_a_source(character, tmp_path, monkeypatch):
    pose = character.neutral_qpos[None]
    clip = GetUp("prone_quadruped_squat", 1.0, np.zeros((9, 3)), Clip("squat", 30.0, pose))
    monkeypatch.setattr(library, "_authored", lambda *_: ([clip], [pose]))
    path = tmp_path / "mine.yaml"
    path.write_text(changed(name="mine", durations=[3.0]), encoding="utf-8")
    config = MotionConfig(source=("authored", str(path)), curves=("mine@3",))
    (getup,) = library.load_motions(config, character).getups
    assert (getup.name, getup.duration, getup.clip) == ("mine@3", 3.0, None)
    path.write_text(changed(name="mine", start="nowhere"), encoding="utf-8")
    with pytest.raises(MotionError, match="mine: start: expected one of prone_quad"):
        library.load_motions(config, character)


def test_a_name_has_letters_of_any_script_with_their_vowel_signs():
    assert all(is_name(x, "_- ", 8) for x in ("हिन्दी", "straße_2", "起き上がる", "a b-c"))
    assert not any(is_name(x, "_- ", 8) for x in ("", "a/b", "a\n", "'a'", "123456789", "a\u202eb"))
