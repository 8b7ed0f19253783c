"""The assistive wrench, its levels, and that its episodes do not count as success."""

import dataclasses

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tiny_task import changed, tiny_task

from getup_jax.config import ConfigError, CurriculumConfig
from getup_jax.core.types import Kinematics
from getup_jax.envs.getup.curriculum import assistive_wrench, start_prioritisation
from getup_jax.envs.getup.curriculum.state import CurriculumState
from getup_jax.envs.getup.episode import CLIP, LYING, STANDING
from getup_jax.motion.getup.curves import FeatureLinks, features

MOST = 300.0  # N


def at(character, rotation: Rotation, spin=(0.0, 0.0, 0.0)) -> tuple[Kinematics, jax.Array]:
    """The neutral pose turned about its root [1, ...], and its features."""
    data = mujoco.MjData(character.model)
    data.qpos[:] = character.neutral_qpos
    data.qpos[3:7] = rotation.as_quat(scalar_first=True)
    mujoco.mj_kinematics(character.model, data)
    links = len(character.link_names)
    position = jnp.asarray(data.xpos[None, 1 : 1 + links], jnp.float32)
    angular = jnp.zeros((1, links, 3)).at[:, 0].set(jnp.asarray(spin))
    kinematics = Kinematics(
        qpos=None, qvel=None, link_position=position, link_quaternion=None,
        link_angular_velocity=angular, link_linear_velocity=None, torque=None, finite=None,
    )  # fmt: skip
    return kinematics, features(FeatureLinks.of(character), position, 0.0)


def hand(
    character, rotation, change, spin=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), height=None
) -> np.ndarray:
    """The wrench [6] where the target is the pose's features plus change [3].

    normal: of the ground; height: of the neck, None: that of the pose.
    """
    kinematics, value = at(character, rotation, spin)
    value = value if height is None else value.at[:, 0].set(height)
    target = value + jnp.asarray(change)
    links, ground = FeatureLinks.of(character), jnp.asarray([normal])
    most = jnp.asarray([MOST])
    return np.asarray(assistive_wrench.wrench(links, kinematics, value, target, ground, most))[0]


def test_it_lifts_below_the_curve_and_never_pushes_down(character):
    upright = Rotation.identity()
    np.testing.assert_allclose(
        hand(character, upright, [0.075, 0, 0]), [0, 0, 150, 0, 0, 0], rtol=1e-5
    )
    np.testing.assert_allclose(hand(character, upright, [0.5, 0, 0]), [0, 0, MOST, 0, 0, 0])
    np.testing.assert_allclose(hand(character, upright, [-0.5, 0, 0]), 0.0)


@pytest.mark.parametrize("seed", range(4))
def test_its_torque_turns_the_torso_towards_the_curves_angles(character, seed):
    rng = np.random.default_rng(seed)
    rotation = Rotation.from_rotvec(rng.uniform(-1.0, 1.0, 3))
    change = np.array([0.0, *rng.uniform(-0.3, 0.3, 2)])
    torque = hand(character, rotation, change)[3:]
    turned = Rotation.from_rotvec(1e-3 * torque / np.linalg.norm(torque)) * rotation
    before, after = at(character, rotation)[1][0], at(character, turned)[1][0]
    goal = before + change
    assert np.abs(after - goal)[1:].sum() < np.abs(before - goal)[1:].sum() - 1e-4


def test_its_torque_is_limited_and_brakes(character):
    torque = hand(character, Rotation.identity(), [0.0, 0.9, 0.9])[3:]
    assert np.linalg.norm(torque) == pytest.approx(0.25 * MOST)
    # .05 rad of error for 1 rad/s, where .5 rad are worth .25 m times the most lift
    brake = hand(character, Rotation.identity(), [0.0, 0.0, 0.0], spin=(0.0, 0.0, 2.0))[3:]
    np.testing.assert_allclose(brake, [0.0, 0.0, -0.25 * MOST * 0.05 * 2.0 / 0.5], rtol=1e-5)


SUPINE = Rotation.from_euler("y", -90, degrees=True)  # the head at -x
PRONE = Rotation.from_euler("y", 90, degrees=True)  # the head at +x
SITTING = Rotation.from_euler("y", -20, degrees=True)  # the legs at +x
SLOPE = np.array([np.sin(0.5), 0.0, np.cos(0.5)])  # down towards +x


def turn(character, pose: Rotation, heading_deg: float, height: float = 0.2) -> float:
    """Torque about z (Nm) on a body that was turned from the pose by the angle about z."""
    body = Rotation.from_euler("z", heading_deg, degrees=True) * pose
    wrench = hand(character, body, np.zeros(3), normal=SLOPE, height=height)
    np.testing.assert_allclose(wrench[:5], 0.0, atol=1e-3)
    return wrench[5]


@pytest.mark.parametrize(("pose", "legs_deg"), [(SUPINE, 0), (PRONE, 180), (SITTING, 0)])
def test_it_turns_legs_that_are_up_the_slope_until_they_are_across(character, pose, legs_deg):
    """Legs at 0 degrees point down the slope; they are left alone up to 1.2 rad (69 degrees)."""
    for angle in (-65, 0, 65):
        assert turn(character, pose, angle - legs_deg) == pytest.approx(0.0, abs=1e-2)
    for angle in (80, 170):
        assert turn(character, pose, angle - legs_deg) < -10.0
        assert turn(character, pose, -angle - legs_deg) > 10.0
    assert turn(character, pose, 170 - legs_deg) == pytest.approx(-0.25 * MOST)


def test_it_turns_nobody_on_even_ground_nor_who_has_risen(character):
    assert turn(character, SITTING, 170, height=0.8) == pytest.approx(0.0, abs=1e-3)
    assert turn(character, SITTING, 170, height=0.7) != pytest.approx(0.0, abs=1.0)
    even = hand(character, SUPINE, np.zeros(3), height=0.2)
    np.testing.assert_allclose(even, 0.0, atol=1e-3)


def test_levels_fall_with_success_rise_with_failure_and_stay_in_range():
    level = jnp.asarray([1.0, 0.5, 0.5, 0.01])
    cell = (jnp.asarray([0, 1, 1, 2, 3]),)
    ended = jnp.asarray([True, True, True, False, True])
    success = jnp.asarray([False, True, True, True, True])
    after = np.asarray(assistive_wrench.update(level, cell, ended, success))
    np.testing.assert_allclose(after, [1.0, 0.46, 0.5, 0.0], atol=1e-6)


def test_the_engine_carries_the_weight_for_one_step_only(character, engine):
    flying = np.tile(character.neutral_qpos, (2, 1))
    flying[:, 2] = 3.0
    state = engine.place(flying, np.zeros((2, character.model.nv)))
    ctrl = jnp.asarray(flying[:, 7:], jnp.float32)
    lift = jnp.zeros((2, 6)).at[0, 2].set(character.weight)
    lifted = engine.step(state, ctrl, wrench=lift)
    mass = character.model.body_mass[1:]

    def fall(after) -> np.ndarray:
        # of the centre of mass: a force on the root moves it as it would a point
        data, speed = mujoco.MjData(character.model), []
        for qpos, qvel in zip(after.kinematics.qpos, after.kinematics.qvel, strict=True):
            data.qpos[:], data.qvel[:] = qpos, qvel
            mujoco.mj_forward(character.model, data)
            mujoco.mj_subtreeVel(character.model, data)
            speed.append(data.subtree_linvel[1, 2])
        return np.array(speed)

    period = engine.control_dt
    np.testing.assert_allclose(fall(lifted), [0.0, -9.81 * period], atol=0.01)
    next_one = engine.step(lifted, ctrl)
    np.testing.assert_allclose(fall(next_one), [-9.81 * period, -9.81 * 2 * period], atol=0.01)
    assert character.weight == pytest.approx(9.81 * mass.sum())


@pytest.fixture(scope="module")
def helped(character):
    return tiny_task(character, changed(prioritisation=0.9, assistive_wrench=0.5))


@pytest.fixture(scope="module")
def first(helped):
    """128 fresh episodes."""
    init = jax.jit(helped.environment.init, static_argnums=2)
    return init(helped.world, jax.random.PRNGKey(0), 128)


def test_half_of_the_starts_get_the_hand_and_standing_ones_never(first, character):
    state = first
    assert state.curriculum.wrench.shape == state.curriculum.success.shape
    lift, standing = np.asarray(state.lift), np.asarray(state.kind) == STANDING
    assert set(np.unique(lift).round(3)) == {0.0, np.float32(0.5 * character.weight).round(3)}
    assert (lift[standing] == 0).all()
    assert abs((lift[~standing] > 0).mean() - 0.5) < 0.2


def test_success_with_the_hand_lowers_its_level_and_is_not_counted(helped, first):
    env, world, count = helped.environment, helped.world, 8
    state = first.replace(getup=first.getup[:count])
    # all stand at the end of an episode that began on the way, half of them with the hand
    standing = env.start(world, state.getup, jnp.full(count, STANDING), jnp.zeros(count, jnp.int32))
    lift = jnp.where(jnp.arange(count) % 2 == 0, 100.0, 0.0)
    learned = state.curriculum
    learned = learned.replace(success=learned.success + 0.5, wrench=learned.wrench * 0.5)
    state = standing.replace(
        key=state.key, curriculum=learned, lift=lift,
        kind=jnp.full(count, CLIP), time=standing.duration + env.config.stand_time_s,
    )  # fmt: skip
    after, output = jax.jit(env.step)(world, state, state.action)
    assert bool(output.truncated.all())
    np.testing.assert_array_equal(np.isnan(output.episode["clip_success"]), lift > 0)
    success, levels = np.asarray(after.curriculum.success), np.asarray(after.curriculum.wrench)
    alone, with_hand = (np.asarray(state.getup)[np.asarray(lift) == x] for x in (0.0, 100.0))
    for style in range(success.shape[1]):
        rises = success[CLIP, style] > 0.5
        assert rises.sum() == (style in alone)
        lowered = levels[CLIP, style] < 0.5
        assert lowered.sum() == (style in with_hand)
    assert (success[:CLIP] == 0.5).all()


def test_the_wrench_needs_the_prioritisation_whose_cells_it_has():
    with pytest.raises(ConfigError, match=r"curriculum\.prioritisation: .*assistive_wrench"):
        CurriculumConfig(assistive_wrench=0.5)


def with_settings(helped, **settings):
    """Its curriculum with other settings."""
    aids = helped.environment.curriculum
    return dataclasses.replace(aids, config=dataclasses.replace(aids.config, **settings))


def test_what_an_episode_starts_from_is_drawn_independently(helped):
    # one key used twice would give the hand, or the short episodes, to some of the styles only
    state = CurriculumState(start_prioritisation.first(helped.world.pool))
    aids = with_settings(helped, short_share=0.5)
    drawn = aids.draw(helped.world, state, jax.random.PRNGKey(1), 8000)
    lying = np.asarray(drawn.kind) != STANDING
    parts = {
        "style": np.asarray(drawn.getup)[lying],
        "row": np.asarray(drawn.row)[lying],
        "kind": np.asarray(drawn.kind)[lying],
        "short": np.isfinite(np.asarray(drawn.lasts))[lying],
        "hand": np.asarray(drawn.assisted)[lying],
    }
    for name in ("short", "hand"):
        for other in {"style", "row", "kind", "short", "hand"} - {name}:
            # its standard error is .01
            assert abs(np.corrcoef(parts[other], parts[name])[0, 1]) < 0.05, (name, other)


def test_starts_with_the_hand_have_a_frontier_of_their_own(helped):
    # alone the first style rises from lying, with the hand the second one does
    learned = start_prioritisation.first(helped.world.pool).at[CLIP].set(1.0).at[LYING, 0].set(1.0)
    levels = jnp.ones_like(learned).at[CLIP].set(0.0).at[LYING, 1].set(0.0)
    aids = with_settings(helped, prioritisation=0.999)
    state = CurriculumState(learned, levels)
    drawn = aids.draw(helped.world, state, jax.random.PRNGKey(2), 4000)
    lying, hand = np.asarray(drawn.kind) == LYING, np.asarray(drawn.assisted)
    style = np.asarray(drawn.getup)
    assert (style[lying & ~hand] == 1).mean() > 0.99
    assert (style[lying & hand] == 0).mean() > 0.99
