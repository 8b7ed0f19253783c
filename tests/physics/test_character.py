from __future__ import annotations

import mujoco
import numpy as np
import pytest

from getup_jax.config import ConfigError, PhysicsConfig
from getup_jax.physics.character import CharacterSpec, character_file, load_character

SIDES = ("l", "r")

# Plagenhoef et al. 1983, men: per cent of the body mass, and the links that share it.
MASS_SHARES = {
    "head and neck": (8.26, ("neck", "head")),
    "thorax": (20.10, ("spine_upper", "shoulder_l", "shoulder_r")),
    "abdomen": (13.06, ("spine_low", "spine_mid")),
    "pelvis": (13.66, ("pelvis",)),
    **{
        f"{name} {side}": (share, (f"{link}_{side}",))
        for side in SIDES
        for name, share, link in (
            ("upper arm", 3.25, "arm"),
            ("forearm", 1.87, "forearm"),
            ("hand", 0.65, "hand"),
            ("thigh", 10.50, "thigh"),
            ("shank", 4.75, "shin"),
            ("foot", 1.43, "foot"),
        )
    },
}

# The thesis' joint table: torque limit (Nm) and ranges (rad) of flexion, abduction and twist.
FULL, WIDE, HALF = (-3.14, 3.14), (-1.57, 1.57), (-1.0, 1.0)
JOINT_TABLE = {
    "spine_upper": (170, (0.0, 0.5), (-0.2, 0.2), (-0.2, 0.2)),
    "spine_mid": (170, (-0.1, 0.6), (-0.3, 0.3), (-0.3, 0.3)),
    "spine_low": (170, (-0.1, 0.6), (-0.3, 0.3), (-0.3, 0.3)),
    "neck": (40, HALF, HALF, HALF),
    "head": (40, HALF, HALF, HALF),
    **{
        f"{name}_{side}": row
        for side in SIDES
        for name, row in {
            "thigh": (170, (-0.4, 2.57), HALF, HALF),
            "shin": (125, (-3.14, 0.0)),
            "foot": (75, WIDE, HALF, HALF),
            "shoulder": (85, FULL, FULL, FULL),
            "arm": (85, FULL, FULL, FULL),
            "forearm": (50, (-3.14, 0.0)),
            "hand": (40, FULL, WIDE, WIDE),
        }.items()
    },
}
AXES = ("flex", "abd", "twist")


def link_positions(character: CharacterSpec, qpos: np.ndarray) -> np.ndarray:
    data = mujoco.MjData(character.model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(character.model, data)
    return data.xpos[1:].copy()


def random_pose(character: CharacterSpec, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    root = np.concatenate([rng.normal(size=3), rng.normal(size=4)])
    root[3:] /= np.linalg.norm(root[3:])
    return np.concatenate([root, rng.uniform(character.joint_lower, character.joint_upper)])


def geom_bottom_and_top(character: CharacterSpec, qpos: np.ndarray) -> tuple[float, float]:
    """Lowest sole corner and highest point of the head (m)."""
    model = character.model
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    corners = []
    for name in ("foot_l", "foot_r"):
        geom = data.geom(name)
        signs = np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1)
        half = model.geom(name).size[:, None] * signs
        corners.append((geom.xmat.reshape(3, 3) @ half)[2].min() + geom.xpos[2])
    head = data.geom("head")
    return min(corners), head.xpos[2] + model.geom("head").size[0]


def test_20_links_of_49_hinges(character):
    assert len(character.link_names) == 20
    assert character.link_names[0] == "pelvis"
    assert character.num_joints == len(character.joint_names) == 49
    assert character.model.nu == 49
    assert character.model.nv == 55


def test_height_and_mass(character):
    assert character.model.body_mass.sum() == pytest.approx(65.0, abs=0.1)
    zero = np.zeros(character.model.nq)
    zero[3] = 1.0
    bottom, top = geom_bottom_and_top(character, zero)
    assert top - bottom == pytest.approx(1.70, abs=1e-9)


@pytest.mark.parametrize("segment", MASS_SHARES)
def test_mass_shares(character, segment):
    percent, links = MASS_SHARES[segment]
    mass = sum(character.model.body(name).mass[0] for name in links)
    assert mass / 65.0 * 100 == pytest.approx(percent, abs=0.01)


def test_the_table_of_shares_covers_every_link_once(character):
    listed = [name for _, links in MASS_SHARES.values() for name in links]
    assert sorted(listed) == sorted(character.link_names)


@pytest.mark.parametrize("link", JOINT_TABLE)
def test_joint_limits_and_torques(character, link):
    torque, *ranges = JOINT_TABLE[link]
    for axis, (lower, upper) in zip(AXES, ranges, strict=False):
        joint = character.joint(f"{link}_{axis}")
        assert character.joint_lower[joint] == pytest.approx(lower)
        assert character.joint_upper[joint] == pytest.approx(upper)
        assert character.torque_limit[joint] == pytest.approx(torque)
        assert character.link_names[character.joint_link[joint]] == link


def test_the_joint_table_covers_every_hinge_once(character):
    listed = [
        f"{link}_{axis}"
        for link, row in JOINT_TABLE.items()
        for axis, _ in zip(AXES, row[1:], strict=False)
    ]
    assert sorted(listed) == sorted(character.joint_names)


def test_mirror_twice_is_the_identity(character):
    poses = np.stack([random_pose(character, seed) for seed in range(5)])
    assert not np.allclose(character.mirror(poses), poses)
    np.testing.assert_array_equal(character.mirror(character.mirror(poses)), poses)


def test_a_mirrored_pose_has_mirrored_link_positions(character):
    swap = {"_l": "_r", "_r": "_l"}
    other = character.links(
        [name[:-2] + swap.get(name[-2:], name[-2:]) for name in character.link_names]
    )
    for seed in range(5):
        pose = random_pose(character, seed)
        mirrored = link_positions(character, character.mirror(pose))
        expected = link_positions(character, pose)[other] * [1, -1, 1]
        np.testing.assert_allclose(mirrored, expected, atol=1e-9)


def test_mirrored_poses_stay_inside_the_limits(character):
    for seed in range(5):
        joints = character.mirror(random_pose(character, seed))[7:]
        assert (joints >= character.joint_lower).all()
        assert (joints <= character.joint_upper).all()


def test_positive_flexion_of_the_knee_range_bends_backwards(character):
    pose = character.neutral_qpos.copy()
    pose[7 + character.joint("shin_l_flex")] = -1.5
    foot = character.link("foot_l")
    before = link_positions(character, character.neutral_qpos)[foot]
    after = link_positions(character, pose)[foot]
    assert after[0] < before[0] - 0.2
    assert after[2] > before[2] + 0.2


def test_the_neutral_pose_stands_on_the_floor_without_touching_itself(character):
    model, data = character.model, mujoco.MjData(character.model)
    data.qpos[:] = character.neutral_qpos
    mujoco.mj_forward(model, data)
    floor = model.geom("floor").id
    feet = {model.geom("foot_l").id, model.geom("foot_r").id}
    touching = set()
    for contact in data.contact:
        pair = {int(contact.geom1), int(contact.geom2)}
        if floor in pair:
            touching |= pair - {floor}
            assert contact.dist > -0.005
        else:
            assert contact.dist > -0.001, [model.geom(i).name for i in pair]
    assert touching <= feet
    bottom, _ = geom_bottom_and_top(character, character.neutral_qpos)
    assert bottom == pytest.approx(0.0, abs=0.003)


def test_head_sphere_is_the_head_geom(character):
    link, centre, radius = character.head_sphere
    assert character.link_names[link] == "head"
    np.testing.assert_allclose(centre, character.model.geom("head").pos)
    assert radius == character.model.geom("head").size[0]


def test_unknown_names_list_the_right_ones(character):
    with pytest.raises(ConfigError, match=r"link 'hed': .* did you mean 'head'.*thigh_r"):
        character.link("hed")
    with pytest.raises(ConfigError, match=r"joint 'shin_l_flx': .* mean 'shin_l_flex'.*foot_r"):
        character.joint("shin_l_flx")


def test_a_missing_file_names_the_shipped_characters():
    with pytest.raises(ConfigError, match=r"physics\.character: no file .*nobody.*humanoid49"):
        load_character(PhysicsConfig(character="nobody"))
    with pytest.raises(ConfigError, match=r"expected a file \.xml or \.yaml, got body\.urdf"):
        load_character(PhysicsConfig(character="body.urdf"))
    with pytest.raises(ConfigError, match=r"no file /nowhere/x\.xml"):
        character_file("/nowhere/x.xml")


def test_physics_settings_reach_the_model():
    config = PhysicsConfig(
        control_hz=20, substeps=5, solver="pgs", iterations=7, gain_scale=2.0,
        torque_scale=0.5, armature=0.03, damping=0.7,
    )  # fmt: skip
    model = load_character(config).model
    assert model.opt.timestep == pytest.approx(0.01)
    assert model.opt.solver == mujoco.mjtSolver.mjSOL_PGS
    assert model.opt.iterations == 7
    np.testing.assert_allclose(model.dof_armature, [0.0] * 6 + [0.03] * 49)
    np.testing.assert_allclose(model.dof_damping, [0.0] * 6 + [0.7] * 49)
    base = load_character(PhysicsConfig(gain_scale=1.0, torque_scale=1.0)).model
    np.testing.assert_allclose(model.actuator_gainprm[:, 0], 2.0 * base.actuator_gainprm[:, 0])
    np.testing.assert_allclose(model.actuator_biasprm, 2.0 * base.actuator_biasprm)
    np.testing.assert_allclose(model.actuator_forcerange, 0.5 * base.actuator_forcerange)


def test_servos_have_a_tenth_of_the_stiffness_as_damping(character):
    model = character.model
    np.testing.assert_allclose(model.actuator_biasprm[:, 1], -model.actuator_gainprm[:, 0])
    np.testing.assert_allclose(model.actuator_biasprm[:, 2], 0.1 * model.actuator_biasprm[:, 1])


BODY = '<body name="pelvis">{root}<geom name="head" size="0.1"/>{child}</body>'
CHILD = (
    '<body name="link"><joint name="bend" type="{joint}" axis="0 1 0"/><geom size="0.1"/></body>'
)
MODEL = (
    "<mujoco><worldbody>{body}</worldbody><actuator>{actuator}</actuator>"
    "<keyframe>{key}</keyframe></mujoco>"
)
ACTUATOR = '<position joint="bend"/>'


def written(tmp_path, root="<freejoint/>", joint="hinge", actuator=ACTUATOR, key="neutral"):
    child = CHILD.format(joint=joint)
    body = BODY.format(root=root, child=child)
    path = tmp_path / "tiny.xml"
    path.write_text(MODEL.format(body=body, actuator=actuator, key=f'<key name="{key}"/>'))
    return PhysicsConfig(character=str(path))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"root": ""}, "one free root"),
        ({"joint": "slide"}, "one free root, then hinges only"),
        ({"actuator": ""}, "one actuator a hinge"),
        ({"key": "sitting"}, "no keyframe named 'neutral', has .*sitting"),
    ],
)
def test_a_character_of_another_form_is_an_error(tmp_path, change, message):
    with pytest.raises(ConfigError, match=message):
        load_character(written(tmp_path, **change))
