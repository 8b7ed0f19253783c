from __future__ import annotations

import copy

import mujoco
import numpy as np
import pytest
import yaml

from getup_jax.config import ConfigError, PhysicsConfig
from getup_jax.physics.character import CharacterSpec, load_character
from own_bodies import gymnasiums

pytest.importorskip("gymnasium")


def load(folder, content) -> CharacterSpec:
    file = folder / "map.yaml"
    file.write_text(yaml.safe_dump(content))
    return load_character(PhysicsConfig(character=str(file), gain_scale=1.0))


@pytest.fixture(scope="module")
def body(tmp_path_factory):
    return load(tmp_path_factory.mktemp("body"), gymnasiums())


def test_every_hinge_has_the_servo_of_its_link(body):
    model = body.model
    assert [model.actuator(i).name for i in range(model.nu)] == list(body.joint_names)
    gains = dict(zip(body.joint_names, model.actuator_gainprm[:, 0], strict=True))
    assert gains["thigh_r_twist"] == 300
    assert gains["shin_l_flex"] == 301
    assert gains["shin_r_flex"] == gains["arm_l_abd"] == 150  # others
    limit = dict(zip(body.joint_names, body.torque_limit, strict=True))
    assert limit["thigh_l_flex"] == 120
    assert limit["forearm_r_flex"] == 50
    np.testing.assert_array_equal(model.actuator_biasprm[:, 1], -model.actuator_gainprm[:, 0])


def test_it_stands_upright_on_its_soles(body):
    data = mujoco.MjData(body.model)
    data.qpos[:] = body.neutral_qpos
    mujoco.mj_forward(body.model, data)
    names = dict(zip(body.joint_names, np.degrees(body.neutral_qpos[7:]), strict=True))
    assert names["shin_l_flex"] == pytest.approx(-10) == names["shin_r_flex"]
    assert names["thigh_r_flex"] == pytest.approx(-5)
    assert names["arm_l_flex"] == 0
    soles = [data.geom_xpos[body.model.geom(f"foot_{s}").id][2] for s in "lr"]
    assert 0.015 < min(soles) < 0.035
    assert data.body("head").xpos[2] > 1.2
    floor = body.model.geom("floor").id
    assert data.contact.dist[(data.contact.geom == floor).any(axis=1)].min() > -0.012


def test_a_geom_takes_the_place_of_the_files_own(body):
    model = body.model
    heads = [i for i in range(model.ngeom) if model.geom(i).name == "head"]
    assert len(heads) == 1
    assert model.body(int(model.geom_bodyid[heads[0]])).name == "head"
    assert model.geom("foot_l").type == mujoco.mjtGeom.mjGEOM_BOX
    assert model.body("foot_l").mass > 0.5


def test_hinges_that_are_no_mirror_images_change_their_sign(body):
    """Its left shoulder turns about (2, -1, 1), its right one about (2, 1, 1)."""
    sign = dict(zip(body.joint_names, body.mirror_sign, strict=True))
    assert sign["arm_l_flex"] == sign["arm_r_abd"] == -1.0
    assert sign["thigh_l_abd"] == sign["spine_upper_flex"] == 1.0
    assert sign["spine_low_abd"] == sign["spine_upper_twist"] == -1.0
    rng = np.random.default_rng(0)
    pose = rng.uniform(-0.3, 0.3, 7 + body.num_joints)
    pose[3:7] /= np.linalg.norm(pose[3:7])
    data, image = mujoco.MjData(body.model), mujoco.MjData(body.model)
    data.qpos[:], image.qpos[:] = pose, body.mirror(pose)
    for state in (data, image):
        mujoco.mj_kinematics(body.model, state)
    for name in ("hand", "foot", "forearm"):
        expected = data.body(f"{name}_l").xpos * [1, -1, 1]
        # the file turns its waist by hundredths of a degree, as text
        np.testing.assert_allclose(image.body(f"{name}_r").xpos, expected, atol=1e-4)


def changed(*path, value):
    content = copy.deepcopy(gymnasiums())
    place = content
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    return content


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (changed("add", "geom", value={}), "add: unknown 'geom'; did you mean 'geoms'"),
        (changed("add", "bodies", "neck", "to", value="chest"), "neck: to: expected one of .*che"),
        (changed("add", "bodies", "neck", "pos", value=[1, 2]), "neck: pos: expected 3 finite"),
        (changed("add", "bodies", "neck", "pos", value=[1, 2, float("nan")]), "3 finite numbers"),
        (changed("add", "geoms", "head", "type", value="blob"), "head: type: unknown 'blob'"),
        (changed("add", "geoms", "head", "colour", value=1), "head: unknown 'colour'"),
        (changed("add", "bodies", "pelvis", value={"to": "head"}), "expected a body that the file"),
        (changed("servos", value={"thigh": [1, 1, 1]}), "none for hinge 'shin_r_flex'; add shin_r"),
        (changed("servos", "others", value=[0, 1, 1]), "expected kp, kv, limit above 0"),
        (changed("servos", "tigh", value=[1, 1, 1]), "servos: unknown 'tigh'; did you mean 'thigh"),
        (changed("servos", value=[1, 2]), r"servos: expected \{name: value\}, got \[1, 2\]"),
        (changed("neutral", "others", value=1), "neutral: unknown 'others'"),
        (changed("neutral", "shin", value="bent"), "neutral: shin_[lr]_flex: expected 1 finite"),
        (changed("root", value="hips"), "root: no body 'hips'; the file has torso"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_in_one_line(tmp_path, content, message):
    with pytest.raises(ConfigError, match=message) as caught:
        load(tmp_path, content)
    assert "\n" not in str(caught.value)
    assert "map.yaml" in str(caught.value)
