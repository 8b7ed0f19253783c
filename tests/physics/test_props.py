"""Balls and the racket: what they do to the model, and how engines move and set them."""

from __future__ import annotations

import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

from getup_jax.config import ConfigError, PhysicsConfig
from getup_jax.core.types import PropCommand
from getup_jax.physics.character import CharacterSpec, load_character
from getup_jax.physics.native import NativeEngine
from getup_jax.physics.props import Ball, Equipment

CONFIG = PhysicsConfig(
    engine="native", character="humanoid28", substeps=4, gain_scale=1, armature=0.02, damping=0
)
BALLS = (Ball("red", 0.05, 0.1), Ball("blue", 0.05, 0.1))
DT = 1 / 30


@pytest.fixture(scope="module")
def character() -> CharacterSpec:
    return load_character(CONFIG, equipment=Equipment(balls=BALLS))


@pytest.fixture(scope="module")
def player() -> CharacterSpec:
    return load_character(CONFIG, equipment=Equipment(balls=BALLS[:1], racket=True))


def placed(engine: NativeEngine, character: CharacterSpec, count: int = 2):
    qpos = np.tile(character.neutral_qpos, (count, 1))
    return engine.place(qpos, np.zeros((count, 6 + character.num_joints)))


def command(mask, position, velocity) -> PropCommand:
    return PropCommand(
        jnp.asarray(mask), jnp.asarray(position, jnp.float32), jnp.asarray(velocity, jnp.float32)
    )


def test_the_model_is_the_character_and_the_scene_has_the_balls(character):
    assert character.ball_names == ("red", "blue")
    assert (character.model.nq, character.scene.nq) == (35, 49)
    assert character.num_joints == character.scene.nu == 28
    np.testing.assert_allclose(character.scene.dof_armature[-12:], 0.0)
    plain = load_character(CONFIG)
    assert plain.scene is plain.model


def test_balls_fall_and_the_character_does_not_notice(character):
    engine, alone = NativeEngine(character, CONFIG), NativeEngine(load_character(CONFIG), CONFIG)
    ctrl = jnp.tile(jnp.asarray(character.neutral_qpos[7:], jnp.float32), (2, 1))
    state, bare = placed(engine, character), placed(alone, character)
    assert bare.kinematics.prop_position is None
    start = np.asarray(state.kinematics.prop_position)
    for _ in range(6):
        state, bare = engine.step(state, ctrl), alone.step(bare, ctrl)
    fallen = start - [0, 0, 0.5 * 9.81 * 0.2**2]
    np.testing.assert_allclose(np.asarray(state.kinematics.prop_position), fallen, atol=0.01)
    np.testing.assert_allclose(
        np.asarray(state.kinematics.prop_velocity)[..., 2], -9.81 * 0.2, atol=1e-4
    )
    np.testing.assert_allclose(state.kinematics.qpos, bare.kinematics.qpos, atol=1e-6)
    np.testing.assert_allclose(
        state.kinematics.link_linear_velocity, bare.kinematics.link_linear_velocity, atol=1e-5
    )


def test_a_command_sets_the_balls_of_its_mask_as_plain_mujoco_would(character):
    engine = NativeEngine(character, CONFIG)
    ctrl = jnp.tile(jnp.asarray(character.neutral_qpos[7:], jnp.float32), (2, 1))
    before = engine.step(placed(engine, character), ctrl)
    mask = [[True, False], [False, False]]
    position, velocity = np.full((2, 2, 3), [1.0, 2.0, 3.0]), np.full((2, 2, 3), [0.5, 0.0, 4.0])
    after = engine.step(before, ctrl, command(mask, position, velocity)).kinematics
    untouched = engine.step(before, ctrl).kinematics

    data, size = mujoco.MjData(engine.model), engine.model
    state = np.array(before.engine).view(np.float64)
    mujoco.mj_setState(size, data, state[0], mujoco.mjtState.mjSTATE_INTEGRATION)
    data.ctrl[:] = ctrl[0]
    data.qpos[35:38], data.qvel[34:37], data.qvel[37:40] = [1, 2, 3], [0.5, 0, 4], 0
    for _ in range(4):
        mujoco.mj_step(size, data)
    mujoco.mj_forward(size, data)
    np.testing.assert_allclose(
        np.asarray(after.prop_position)[0, 0], data.body("red").xpos, atol=1e-6
    )
    np.testing.assert_allclose(np.asarray(after.prop_velocity)[0, 0], data.qvel[34:37], atol=1e-6)
    np.testing.assert_allclose(after.qpos[0], data.qpos[:35], atol=1e-6)
    np.testing.assert_array_equal(
        np.asarray(after.prop_position)[1], np.asarray(untouched.prop_position)[1]
    )
    np.testing.assert_array_equal(
        np.asarray(after.prop_position)[0, 1], np.asarray(untouched.prop_position)[0, 1]
    )


def test_balls_meet_the_floor_alone(character):
    model, data = character.scene, mujoco.MjData(character.scene)
    data.qpos[:35] = character.neutral_qpos
    data.qpos[35:38] = data.qpos[:3] + np.array([0, 0, 0.3])  # inside the chest
    data.qpos[42:45] = [2.0, 0.0, 0.04]  # on the floor
    mujoco.mj_forward(model, data)
    touching = {
        frozenset((model.geom(c.geom1).name, model.geom(c.geom2).name)) for c in data.contact
    }
    assert {pair for pair in touching if "red" in pair or "blue" in pair} == {
        frozenset(("floor", "blue"))
    }


def test_the_racket_hand_has_a_wrist_of_its_own(player):
    assert player.num_joints == 31
    first = player.joint("hand_r_flex")
    assert player.joint_names[first - 1 : first + 3] == (
        "forearm_r_flex", "hand_r_flex", "hand_r_abd", "hand_r_twist",
    )  # fmt: skip
    plain = load_character(CONFIG)
    keep = [i for i, name in enumerate(player.joint_names) if not name.startswith("hand")]
    for field in ("joint_lower", "joint_upper", "torque_limit"):
        np.testing.assert_allclose(getattr(player, field)[keep], getattr(plain, field))
    np.testing.assert_allclose(player.model.actuator_biasprm[keep], plain.model.actuator_biasprm)
    np.testing.assert_allclose(player.neutral_qpos[7:][keep], plain.neutral_qpos[7:])
    np.testing.assert_allclose(player.neutral_qpos[7 + first : 10 + first], 0.0)


@pytest.mark.parametrize("speed", [3.0, 8.0, 16.0])
def test_a_ball_bounces_off_the_racket(player, speed):
    model, data = player.scene, mujoco.MjData(player.scene)
    place, rate = 7 + player.num_joints, 6 + player.num_joints
    data.qpos[:place] = player.neutral_qpos
    data.ctrl[:] = player.neutral_qpos[7:]
    mujoco.mj_kinematics(model, data)
    centre, face = data.geom("racket").xpos, data.geom("racket").xmat.reshape(3, 3)[:, 2]
    face = face.copy()
    data.qpos[place : place + 3] = centre + 0.5 * face
    data.qvel[rate : rate + 3] = -speed * face
    for _ in range(round(0.5 / speed * 120) + 3):
        mujoco.mj_step(model, data)
    assert 0.4 * speed < data.qvel[rate : rate + 3] @ face < speed


def test_a_racket_needs_a_fixed_right_hand():
    with pytest.raises(ConfigError, match="'hand_r' has no joints of its own"):
        load_character(PhysicsConfig(), equipment=Equipment(racket=True))
