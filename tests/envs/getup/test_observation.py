from __future__ import annotations

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from getup_jax.core import quaternion
from getup_jax.core.types import Kinematics
from getup_jax.envs.getup.observation import Observer
from getup_jax.physics.terrain import Terrain

FLAT = Terrain.flat()
BLOCKS = {
    "joint_rotation": 76,
    "link_position": 57,
    "link_angular_velocity": 57,
    "link_linear_velocity": 57,
    "features": 3,
    "height_map": 25,
    "targets": 12,
    "action": 65,
}


class Ramp:
    """Ground that rises along x."""

    def height(self, xy):
        return 0.1 * xy[..., 0]


@pytest.fixture(scope="module")
def observer(character) -> Observer:
    return Observer.of(character, num_lookahead=4, action_size=65)


def random_states(character, count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    qpos = np.tile(character.neutral_qpos, (count, 1))
    qpos[:, :3] = rng.uniform(0.2, 2.0, (count, 3))
    qpos[:, 3:7] = Rotation.random(count, rng=rng).as_quat(scalar_first=True)
    qpos[:, 7:] = rng.uniform(character.joint_lower, character.joint_upper, (count, 49))
    return qpos, rng.normal(size=(count, 55))


def observe(observer: Observer, kinematics: Kinematics, terrain=FLAT) -> dict[str, np.ndarray]:
    """The blocks of an observation with numbered targets and action."""
    size = len(kinematics.qpos)
    targets = jnp.broadcast_to(jnp.arange(12.0).reshape(4, 3), (size, 4, 3))
    action = jnp.broadcast_to(100.0 + jnp.arange(65.0), (size, 65))
    posture = observer.posture(kinematics, terrain)
    full = np.asarray(observer.observe(posture, targets, action))
    assert full.shape == (size, observer.size)
    return {name: full[:, where] for name, where in observer.slices().items()}


def standing(engine, character, yaw: float = 0.0, x: float = 0.0) -> Kinematics:
    qpos = character.neutral_qpos[None].copy()
    qpos[0, 0] = x
    qpos[0, 3:7] = Rotation.from_rotvec([0.0, 0.0, yaw]).as_quat(scalar_first=True)
    return engine.place(qpos, np.zeros((1, 55))).kinematics


def test_352_numbers_in_the_documented_blocks(observer):
    assert observer.size == 352
    assert dict(observer.table) == BLOCKS
    where = observer.slices()
    sizes = {name: len(range(352)[where[name]]) for name in where}
    assert sizes == BLOCKS
    covered = np.concatenate([np.arange(352)[where[name]] for name in where])
    np.testing.assert_array_equal(covered, np.arange(352))


def test_another_task_has_another_size(character):
    observer = Observer.of(character, num_lookahead=2, action_size=10)
    assert observer.size == 352 - 6 - 55


def test_targets_and_action_are_passed_through(observer, engine, character):
    blocks = observe(observer, standing(engine, character))
    np.testing.assert_array_equal(blocks["targets"][0], np.arange(12))
    np.testing.assert_array_equal(blocks["action"][0], 100 + np.arange(65))


@pytest.mark.parametrize("yaw", [0.7, 2.9, -1.8])
def test_heading_and_horizontal_place_do_not_matter(observer, engine, character, yaw):
    qpos, qvel = random_states(character, 4)
    turn = Rotation.from_rotvec([0.0, 0.0, yaw])
    moved, moving = qpos.copy(), qvel.copy()
    moved[:, :3] = turn.apply(qpos[:, :3]) + np.array([3.0, -5.0, 0.0])
    start = Rotation.from_quat(qpos[:, 3:7], scalar_first=True)
    moved[:, 3:7] = (turn * start).as_quat(scalar_first=True)
    moving[:, :3] = turn.apply(qvel[:, :3])  # the angular part is in the root's own frame
    before = observe(observer, engine.place(qpos, qvel).kinematics)
    after = observe(observer, engine.place(moved, moving).kinematics)
    for name, block in before.items():
        # a rotation by pi has two quaternions with w = 0
        np.testing.assert_allclose(after[name], block, atol=2e-4, err_msg=name)


def test_what_should_matter_does(observer, engine, character):
    qpos, qvel = random_states(character, 1)
    before = observe(observer, engine.place(qpos, qvel).kinematics)
    higher, tilted = qpos.copy(), qpos.copy()
    higher[:, 2] += 0.5
    tilt = Rotation.from_rotvec([0.5, 0.0, 0.0]) * Rotation.from_quat(
        qpos[:, 3:7], scalar_first=True
    )
    tilted[:, 3:7] = tilt.as_quat(scalar_first=True)
    up = observe(observer, engine.place(higher, qvel).kinematics)
    np.testing.assert_allclose(up["height_map"] - before["height_map"], 0.5, atol=1e-5)
    np.testing.assert_allclose(up["features"] - before["features"], [[0.5, 0, 0]], atol=1e-5)
    leaning = observe(observer, engine.place(tilted, qvel).kinematics)
    assert np.abs(leaning["link_position"] - before["link_position"]).max() > 0.1


def test_values_of_standing(observer, engine, character):
    blocks = observe(observer, standing(engine, character, yaw=1.1, x=4.0))
    root = character.neutral_qpos[2]
    # 0.09 + 0.11 + 0.11 + 0.22 m from the pelvis to the neck
    np.testing.assert_allclose(blocks["features"], [[root + 0.53, np.pi / 2, np.pi / 2]], atol=1e-4)
    np.testing.assert_allclose(blocks["height_map"], root, atol=1e-5)
    np.testing.assert_allclose(blocks["link_angular_velocity"], 0.0)
    np.testing.assert_allclose(blocks["link_linear_velocity"], 0.0)
    position = blocks["link_position"].reshape(19, 3)
    names = character.link_names[1:]
    np.testing.assert_allclose(position[names.index("neck")], [0, 0, 0.53], atol=1e-5)
    np.testing.assert_allclose(position[names.index("thigh_l")], [0, 0.088, -0.04], atol=1e-5)
    np.testing.assert_allclose(position[names.index("thigh_r")], [0, -0.088, -0.04], atol=1e-5)
    joints = blocks["joint_rotation"].reshape(19, 4)
    np.testing.assert_allclose(joints[names.index("head")], [1, 0, 0, 0], atol=1e-6)
    # the knee of the neutral pose: 0.08 rad about the lateral axis
    bend = [np.cos(0.04), 0, np.sin(0.04), 0]
    np.testing.assert_allclose(joints[names.index("shin_l")], bend, atol=1e-5)


def test_velocities_are_seen_from_the_heading(observer, engine, character):
    qpos, qvel = character.neutral_qpos[None].copy(), np.zeros((1, 55))
    yaw = Rotation.from_rotvec([0.0, 0.0, np.pi / 2])
    qpos[0, 3:7] = yaw.as_quat(scalar_first=True)
    qvel[0, :3] = yaw.apply([1.5, 0.0, 0.0])  # forwards
    blocks = observe(observer, engine.place(qpos, qvel).kinematics)
    linear = blocks["link_linear_velocity"].reshape(19, 3)
    np.testing.assert_allclose(linear, np.tile([1.5, 0, 0], (19, 1)), atol=1e-5)


def test_joint_rotations_rebuild_the_link_rotations(observer, engine, character):
    qpos, qvel = random_states(character, 5, seed=3)
    link = engine.place(qpos, qvel).kinematics.link_quaternion
    joint = observer.joint_rotation(link)
    assert (np.asarray(joint[..., 0]) >= 0).all()
    rebuilt = [link[:, 0]]
    for index, parent in enumerate(observer.parents):
        rebuilt.append(quaternion.multiply(rebuilt[parent], joint[:, index]))
    same = np.abs(np.sum(np.stack(rebuilt, axis=1) * np.asarray(link), axis=-1))
    np.testing.assert_allclose(same, 1.0, atol=1e-5)  # up to sign


def test_the_height_map_runs_from_front_to_back_and_left_to_right(observer, engine, character):
    root = character.neutral_qpos[2]
    step = 0.1 * np.array([0.5, 0.25, 0.0, -0.25, -0.5])
    ahead = observe(observer, standing(engine, character), Ramp())["height_map"].reshape(5, 5)
    np.testing.assert_allclose(ahead, root - np.tile(step[:, None], (1, 5)), atol=1e-5)
    # facing +y, the ground falls to the left, which is -x
    turned = standing(engine, character, yaw=np.pi / 2)
    aside = observe(observer, turned, Ramp())["height_map"].reshape(5, 5)
    np.testing.assert_allclose(aside, root + np.tile(step[None, :], (5, 1)), atol=1e-5)


def test_the_height_feature_is_above_the_mean_ground(observer, engine, character):
    flat = observe(observer, standing(engine, character, x=2.0))["features"]
    ramp = observe(observer, standing(engine, character, x=2.0), Ramp())["features"]
    np.testing.assert_allclose(flat[:, 0] - ramp[:, 0], 0.2, atol=1e-5)
    np.testing.assert_allclose(flat[:, 1:], ramp[:, 1:], atol=1e-6)


def test_relief_is_seen_larger_and_a_plane_as_it_is(engine, character, observer):
    larger = dataclasses.replace(observer, relief_gain=4.0)
    kinematics = standing(engine, character)
    plain, seen = observe(observer, kinematics, Ramp()), observe(larger, kinematics, Ramp())
    mean = plain["height_map"].mean()
    expected = mean + 4.0 * (plain["height_map"] - mean)
    np.testing.assert_allclose(seen["height_map"], expected, atol=1e-5)
    np.testing.assert_array_equal(seen["features"], plain["features"])
    flat = observe(larger, kinematics)["height_map"]
    np.testing.assert_allclose(flat, observe(observer, kinematics)["height_map"], atol=1e-6)
