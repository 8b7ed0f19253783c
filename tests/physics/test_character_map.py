from __future__ import annotations

import re
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

from getup_jax.config import ConfigError, PhysicsConfig
from getup_jax.core.resources import asset_path
from getup_jax.motion.authoring.keyframe_clip import clip_from_keyframes
from getup_jax.motion.authoring.keyframe_file import read_keyframes
from getup_jax.physics.character import CharacterSpec, load_character
from getup_jax.physics.model_file import character_xml

SCALE = 0.8


def renamed() -> tuple[str, dict[str, dict[str, str]]]:
    """The shipped body with the names of another, and which of them is which."""
    text = asset_path("humanoid49.xml").read_text(encoding="utf-8")
    spec = mujoco.MjSpec.from_string(text)
    maps = {}
    for kind, elements in (("bodies", spec.bodies), ("joints", spec.joints), ("geoms", spec.geoms)):
        names = [x.name for x in elements if x.name and x.name not in ("world", "floor", "root")]
        maps[kind] = {f"{kind[0]}_{name.upper()}": name for name in names}
    for old, tags in (("bodies", "body[12]?"), ("joints", "joint"), ("geoms", "geom")):
        words = {name: theirs for theirs, name in maps[old].items()}
        kind = old.removesuffix("s").removesuffix("ie") if old != "bodies" else "body"

        def own(match: re.Match, words=words) -> str:
            return f'{match[1]}"{words.get(match[2], match[2])}"'

        text = re.sub(rf'(<{kind}\b[^>]*?\bname=)"([^"]*)"', own, text)
        text = re.sub(rf'(\s{tags}=)"([^"]*)"', own, text)
    text = text.replace('<key name="neutral"', '<key name="stand"')
    return text, maps | {"keyframes": {"stand": "neutral"}}


def written(folder: Path, text: str, maps: dict, mjcf: str = "body.xml") -> str:
    (folder / "body.xml").write_text(text)
    lines = [f"mjcf: {mjcf}"]
    for kind, names in maps.items():
        lines += [f"{kind}:", *(f"  {old}: {new}" for old, new in names.items())]
    (folder / "map.yaml").write_text("\n".join(lines) + "\n")
    return str(folder / "map.yaml")


def load(name: str) -> CharacterSpec:
    return load_character(PhysicsConfig(character=name))


def test_a_body_of_other_names_is_the_shipped_one(tmp_path):
    text, maps = renamed()
    assert "pelvis" not in re.findall(r'name="([^"]*)"', text)
    found, expected = load(written(tmp_path, text, maps)), load("humanoid49")
    assert found.link_names == expected.link_names
    assert found.joint_names == expected.joint_names
    for name in ("body_mass", "geom_size", "actuator_gainprm", "exclude_signature", "jnt_range"):
        same = getattr(expected.model, name)
        np.testing.assert_array_equal(getattr(found.model, name), same, err_msg=name)
    np.testing.assert_array_equal(found.neutral_qpos, expected.neutral_qpos)
    assert "shin_l_flex" in character_xml(PhysicsConfig(character=str(tmp_path / "map.yaml")))


def test_a_file_in_a_package_is_found_without_importing_it(tmp_path, monkeypatch):
    package = tmp_path / "bodies_of_others"
    package.mkdir()
    (package / "__init__.py").write_text("raise RuntimeError\n")
    text, maps = renamed()
    monkeypatch.syspath_prepend(str(tmp_path))
    path = written(package, text, maps, "package:bodies_of_others/body.xml")
    assert load(path).link_names[0] == "pelvis"
    assert "bodies_of_others" not in sys.modules


def scaled(factor: float) -> str:
    """The shipped body of another size, as MJCF."""
    spec = mujoco.MjSpec.from_file(str(asset_path("humanoid49.xml")))
    for body in spec.bodies:
        body.pos = body.pos * factor
    for geom in spec.geoms:
        if geom.name != "floor":
            geom.pos, geom.size = geom.pos * factor, geom.size * factor
            geom.fromto = geom.fromto * factor
    for key in spec.keys:
        qpos = np.array(key.qpos)
        key.qpos = np.concatenate([qpos[:3] * factor, qpos[3:]])
    spec.compile()
    return spec.to_xml()


def test_authored_motions_fit_a_body_of_another_size(tmp_path):
    (tmp_path / "small.xml").write_text(scaled(SCALE))
    small, own = load(str(tmp_path / "small.xml")), load("humanoid49")
    file = asset_path("motions", "supine_situp_squat.yaml")
    clips = [clip_from_keyframes(read_keyframes(file, x), x) for x in (small, own)]
    assert clips[0].qpos[-1, 2] == pytest.approx(SCALE * clips[1].qpos[-1, 2], rel=0.03)
    assert clips[0].qpos[0, 2] == pytest.approx(SCALE * clips[1].qpos[0, 2], abs=0.03)
    data = mujoco.MjData(small.model)
    soles = [small.model.geom(f"foot_{side}").id for side in "lr"]
    data.qpos[:] = clips[0].qpos[-1]
    mujoco.mj_kinematics(small.model, data)
    low = [data.geom_xpos[i][2] - small.model.geom_size[i].min() for i in soles]
    np.testing.assert_allclose(low, 0.0, atol=0.02)  # it stands on the floor


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"bodies": {"b_PELVUS": "pelvis"}}, "b_PELVUS': not in the file; did you mean 'b_PELVIS"),
        ({"bodies": {"b_PELVIS": "b_HEAD"}}, "b_HEAD: would be the name of two"),
        ({"bodies": {"b_PELVIS": "hips"}}, "lacks body 'pelvis'"),
        ({"joint": {}}, "unknown 'joint'; did you mean 'joints'"),
    ],
)
def test_a_wrong_map_is_said_in_one_line(tmp_path, change, message):
    text, maps = renamed()
    with pytest.raises(ConfigError, match=re.escape(message)) as caught:
        load(written(tmp_path, text, {**maps, **change}))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("mjcf", "message"),
    [("nothing.xml", "mjcf: no file"), ("package:no_such_thing/a.xml", "no package 'no_such")],
)
def test_a_file_that_is_not_there_is_said(tmp_path, mjcf, message):
    text, maps = renamed()
    with pytest.raises(ConfigError, match=message):
        load(written(tmp_path, text, maps, mjcf))


def test_the_body_of_composite_motion_gets_up_under_other_names():
    found, plain = load("humanoid28_getup"), load("humanoid28")
    order = [name.replace("torso", "spine_upper") for name in plain.joint_names]
    assert list(found.joint_names) == order
    assert [n for n in found.link_names if n != "neck"] == [
        name.replace("torso", "spine_upper") for name in plain.link_names
    ]
    np.testing.assert_array_equal(found.neutral_qpos, plain.neutral_qpos)
    np.testing.assert_array_equal(found.torque_limit, plain.torque_limit)
    assert found.weight == pytest.approx(plain.weight)
    data = mujoco.MjData(found.model)
    data.qpos[:] = np.random.default_rng(0).normal(0.0, 0.3, found.model.nq)
    mujoco.mj_kinematics(found.model, data)
    head, neck = (data.body(name).xpos for name in ("head", "neck"))
    np.testing.assert_allclose(head, neck, atol=1e-4)  # the height of where the head is joined
