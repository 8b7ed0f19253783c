from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tiny_task import CONFIG, LATENT, getups, untrained_prior

from getup_jax.config import NetworkConfig, PhysicsConfig
from getup_jax.core import mirror
from getup_jax.core.mirror import AXIAL, POLAR, Symmetry, concatenated, signed
from getup_jax.envs.getup.build import BuiltTask, assemble
from getup_jax.envs.getup.observation import Observer
from getup_jax.envs.getup.symmetry import action_mirror, find_symmetry, observation_mirror
from getup_jax.physics.character import CharacterSpec, load_character
from getup_jax.physics.mirror_image import joint_mirror
from getup_jax.physics.native import NativeEngine
from getup_jax.pose_prior.prior import from_dict, to_dict
from getup_jax.rl.learner import Learner, make_learner
from getup_jax.rl.state import TrainState
from getup_jax.runtime.checkpoint import CHECKPOINTS, load_policy, restore_learner, save_learner
from getup_jax.runtime.pytree_store import from_nested

STEPS = 30
NETWORK = NetworkConfig(hidden_sizes=(32,))
# PGS goes through the contacts one after the other, and an image has them in another order. What
# it has not solved after ten sweeps then differs by 1e-3 rad in the first step of a standing body,
# which grows from step to step. Newton finds the one solution that there is.
NEWTON = dataclasses.replace(CONFIG, physics=PhysicsConfig(engine="native", solver="newton"))


class Hillside:
    """Ground that rises to the left; `side` -1 is its mirror image."""

    def __init__(self, side: float):
        self.side = side

    def height(self, xy):
        return 0.1 * xy[..., 0] + 0.3 * self.side * xy[..., 1]


@pytest.fixture(scope="module")
def task() -> BuiltTask:
    """With a mirrored prior, and every style followed by its mirror image."""
    character = load_character(NEWTON.physics)
    prior = untrained_prior(character, mirrored=True)
    built = assemble(NEWTON, character, getups(character), prior, lambda _: None)
    points = built.world.points.at[..., 1].add(0.2)  # leaning to one side
    both = jnp.stack([points[0], mirror.CURVE(points[0])])
    duration = jnp.stack(2 * [built.world.duration[0]])
    return dataclasses.replace(built, world=built.world.replace(points=both, duration=duration))


@pytest.fixture(scope="module")
def learner(task) -> Learner:
    ppo = dataclasses.replace(CONFIG.ppo, num_envs=8, num_steps=4, minibatch_size=16, epochs=1)
    return make_learner(task.environment, NETWORK, ppo, total_steps=1000)


@dataclasses.dataclass(frozen=True, eq=False)
class Trained:
    """A learner's compiled functions, and what they gave."""

    begin: Callable[[Any, jax.Array], TrainState]
    iterate: Callable[[Any, TrainState], tuple[TrainState, dict[str, jax.Array]]]
    first: TrainState
    one: TrainState  # after an iteration


@pytest.fixture(scope="module")
def trained(task, learner) -> Trained:
    begin, iterate = jax.jit(learner.init), jax.jit(learner.iteration)
    first = begin(task.world, jax.random.PRNGKey(0))
    return Trained(begin, iterate, first, iterate(task.world, first)[0])


def symmetry_of(task: BuiltTask) -> Symmetry:
    found = task.environment.symmetry
    assert found is not None
    return found


def velocity_mirror(character: CharacterSpec) -> mirror.SignedPermutation:
    return concatenated([signed(POLAR), signed(AXIAL), joint_mirror(character)])


def mirrored_pair(character: CharacterSpec, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A random state near the ground and its image: qpos [2, 7 + J], qvel [2, 6 + J]."""
    rng = np.random.default_rng(seed)
    qpos = character.neutral_qpos.copy()
    qpos[:3] = rng.normal(size=3) * [1.0, 1.0, 0.1] + [0.0, 0.0, 0.5]
    qpos[3:7] = Rotation.random(rng=rng).as_quat(scalar_first=True)
    lower, upper = character.joint_lower, character.joint_upper
    qpos[7:] = np.clip(qpos[7:] + 0.4 * rng.normal(size=len(lower)), lower, upper)
    qvel = rng.normal(size=6 + character.num_joints)
    image = velocity_mirror(character)(qvel)
    return np.stack([qpos, character.mirror(qpos)]), np.stack([qvel, image])


def test_the_observation_of_the_image_is_the_image_of_the_observation(character, engine):
    action = action_mirror(character, LATENT)
    observer = Observer.of(character, 4, action.size, relief_gain=4.0)
    image = observation_mirror(observer, character, action)
    rng = np.random.default_rng(0)
    for seed in range(3):
        kinematics = engine.place(*mirrored_pair(character, seed)).kinematics
        targets = jnp.asarray(rng.normal(size=(4, 3)), jnp.float32)
        acted = jnp.asarray(rng.normal(size=action.size), jnp.float32)
        seen = []
        for row, side in enumerate((1.0, -1.0)):
            one = jax.tree.map(lambda x, row=row: x[row : row + 1], kinematics)
            curve, last = (targets, acted) if row == 0 else (mirror.CURVE(targets), action(acted))
            posture = observer.posture(one, Hillside(side))
            seen.append(np.asarray(observer.observe(posture, curve[None], last[None]))[0])
        assert np.abs(image(seen[0]) - seen[0]).max() > 0.5
        for block, where in observer.slices().items():
            np.testing.assert_allclose(
                image(seen[0])[where], seen[1][where], atol=2e-5, err_msg=block
            )


def test_twice_is_the_identity(task):
    found = symmetry_of(task)
    rng = np.random.default_rng(1)
    for image, size in ((found.observation, 352), (found.action, 65)):
        x = rng.normal(size=(3, size)).astype(np.float32)
        np.testing.assert_allclose(image(image(x)), x, atol=1e-6)


def test_a_block_whose_image_is_not_known_is_named(task, character):
    observer, action = task.environment.observer, symmetry_of(task).action
    strange = dataclasses.replace(observer, table=(*observer.table, ("wind", 2)))
    with pytest.raises(ValueError, match=r"block wind: expected its mirror image, of 2 numbers"):
        observation_mirror(strange, character, action)


def test_servo_targets_of_images_are_images(task):
    env, found = task.environment, symmetry_of(task)
    rng = np.random.default_rng(2)
    action = jnp.asarray(rng.normal(size=(5, 65)), jnp.float32)
    condition = jnp.asarray(rng.uniform(0.2, 2.0, (5, 3)), jnp.float32)
    units = env.decoder(task.world)
    target = units.target(action, condition)
    image = units.target(found.action(action), mirror.CURVE(condition))
    np.testing.assert_allclose(image, joint_mirror(env.character)(target), atol=1e-5)


def test_a_state_and_its_image_stay_images_under_the_policy(task, learner):
    """The whole loop: observation, policy, prior, filter, servos, contacts, rewards."""
    env, world, found = task.environment, task.world, symmetry_of(task)
    qpos, qvel = mirrored_pair(env.character, seed=4)
    state = jax.jit(env.start)(world, jnp.arange(2), *jnp.zeros((2, 2), jnp.int32))
    action = 0.3 * jax.random.normal(jax.random.PRNGKey(3), (65,))
    first = jnp.stack([action, found.action(action)])
    none = jnp.zeros_like(state.start_offset)  # those of the start are of another pose
    placed = env.engine.place(qpos, 0.3 * qvel)
    state = state.replace(physics=placed, action=first, start_offset=none)
    state, _ = jax.jit(env.advance)(world, state, first)  # now it is observed
    policy = jax.jit(learner.init_learner)(jax.random.PRNGKey(0)).policy
    # the first actions are nearly zero
    actor = jax.tree.map(lambda x: 3.0 * x, policy.actor)
    policy = dataclasses.replace(policy, actor=actor)

    @jax.jit
    def step(state):
        return env.advance(world, state, learner.act(policy, state.observation))

    touched = False
    for _ in range(STEPS):
        state, output = step(state)
        one, two = np.asarray(state.observation)
        np.testing.assert_allclose(found.observation(one), two, atol=1e-3)
        np.testing.assert_allclose(output.reward[0], output.reward[1], atol=1e-5)
        touched |= bool(np.asarray(state.physics.kinematics.link_position)[0, :, 2].min() < 0.1)
    assert touched
    moved = np.abs(np.asarray(state.physics.kinematics.qpos)[0, 7:] - qpos[0, 7:])
    assert moved.max() > 0.3


def drift(solver: str, iterations: int, steps: int) -> float:
    """How far a standing body and its image are apart (rad, m) after random servo targets."""
    config = PhysicsConfig(engine="native", solver=solver, iterations=iterations)
    character = load_character(config)
    engine, rng = NativeEngine(character, config), np.random.default_rng(0)
    lower, upper, pose = character.joint_lower, character.joint_upper, character.neutral_qpos
    qvel = 0.1 * rng.normal(size=55)
    state = engine.place(
        np.stack([pose, character.mirror(pose)]), np.stack([qvel, velocity_mirror(character)(qvel)])
    )
    step = jax.jit(engine.step)
    for _ in range(steps):
        target = np.clip(pose[7:] + 0.3 * rng.normal(size=49), lower, upper)
        both = np.stack([target, joint_mirror(character)(target)])
        state = step(state, jnp.asarray(both, jnp.float32))
    one, two = np.asarray(state.kinematics.qpos)
    return float(np.abs(character.mirror(one) - two).max())


def test_physics_is_symmetric_as_far_as_the_solver_finds_its_solution():
    assert drift("newton", 10, STEPS) < 1e-6
    converged, shipped = drift("pgs", 50, 1), drift("pgs", 10, 1)
    assert converged < 1e-5 < shipped < 1e-2


def test_a_learner_is_equivariant_and_stays_so_while_it_trains(task, learner, trained):
    found, state = symmetry_of(task), trained.first
    for _ in range(2):
        state, metrics = trained.iterate(task.world, state)
        losses = [float(x) for name, x in metrics.items() if name.startswith("loss/")]
        assert losses
        assert np.isfinite(losses).all()
    before = trained.first.learner.policy.actor
    changed = jax.tree.map(lambda a, b: bool((a != b).any()), before, state.learner.policy.actor)
    assert any(jax.tree.leaves(changed))
    policy, seen = state.learner.policy, state.environment.observation
    np.testing.assert_allclose(
        learner.act(policy, found.observation(seen)),
        found.action(learner.act(policy, seen)),
        atol=1e-5,
    )
    value = learner.value(state.learner, seen)
    np.testing.assert_allclose(
        learner.value(state.learner, found.observation(seen)), value, rtol=1e-5, atol=1e-5
    )


def test_what_has_no_mirror_image(character, task):
    observer = task.environment.observer
    plain, mirrored = (untrained_prior(character, mirrored=m) for m in (False, True))
    assert find_symmetry(character, observer, mirrored) is not None
    assert find_symmetry(character, observer, plain) is None
    lame = dataclasses.replace(character, torque_limit=np.arange(49.0))
    assert find_symmetry(lame, observer, mirrored) is None


def test_without_a_prior_the_action_is_offsets_alone(character):
    observer = Observer.of(character, 4, 49)
    found = find_symmetry(character, observer, None)
    assert found is not None
    assert (found.action.size, found.observation.size) == (49, 352 - 16)


def test_a_mirrored_run_is_restored_and_goes_on_bit_for_bit(task, learner, trained, tmp_path):
    iterate, state = trained.iterate, trained.one
    item = {"policy": state.learner.policy, "prior": to_dict(task.world.prior)}
    save_learner(tmp_path / CHECKPOINTS, 1, state, NEWTON, item, {})
    template = trained.begin(task.world, jax.random.PRNGKey(1))
    restored = restore_learner(tmp_path / CHECKPOINTS, template).state
    for _ in range(2):
        state, _ = iterate(task.world, state)
        restored, _ = iterate(task.world, restored)
    assert jax.tree.all(jax.tree.map(np.array_equal, state, restored))
    loaded = load_policy(tmp_path)
    assert loaded.config.network.mirror
    prior = from_dict(loaded.prior)
    env = task.environment
    found = find_symmetry(env.character, env.observer, prior)
    assert found is not None
    np.testing.assert_array_equal(found.observation.index, symmetry_of(task).observation.index)
    policy = from_nested(template.learner.policy, loaded.policy, "here")
    seen = state.environment.observation
    action = learner.act(policy, seen)
    np.testing.assert_allclose(
        learner.act(policy, found.observation(seen)), found.action(action), atol=1e-5
    )
