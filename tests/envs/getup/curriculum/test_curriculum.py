"""Random pushes; what the curriculum draws is tested with what it draws for."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from tiny_task import changed, tiny_task

from getup_jax.config import CurriculumConfig, PhysicsConfig
from getup_jax.envs.getup.curriculum.curriculum import Curriculum
from getup_jax.motion.getup.curves import FeatureLinks
from getup_jax.physics.character import load_character

DT = 1 / 30
LINKS = FeatureLinks(root=0, neck=1, left_hip=2, right_hip=3)
KEY = jax.random.PRNGKey(3)


@dataclasses.dataclass
class Standing:
    """Positions of the four links, the neck .5 m above the root and a bit in front of it."""

    size: int

    @property
    def link_position(self) -> jax.Array:
        one = jnp.asarray([[1.0, 2.0, 0.9], [1.1, 2.0, 1.4], [1.0, 2.1, 0.9], [1.0, 1.9, 0.9]])
        return jnp.tile(one, (self.size, 1, 1))


def pushes(size: int, **settings) -> np.ndarray | None:
    config = CurriculumConfig(**settings)
    curriculum = Curriculum(config, 0.0, DT, 0.0, 0.5)
    found = curriculum.push(KEY, LINKS, Standing(size))  # pyright: ignore[reportArgumentType]
    return None if found is None else np.asarray(found)


def test_there_are_none_unless_they_are_asked_for():
    assert pushes(4) is None


def test_pushes_are_level_of_any_size_up_to_the_most_and_come_at_their_rate():
    found = pushes(20_000, push_ns=30.0, push_interval_s=1.0)
    force, moment = found[:, :3], found[:, 3:]
    impulse = np.linalg.norm(force, axis=1) * DT
    pushed = impulse > 0
    assert abs(pushed.mean() - DT) < 0.004
    assert 29.0 < impulse.max() <= 30.0
    assert abs(impulse[pushed].mean() - 15.0) < 1.5
    assert (force[:, 2] == 0).all()
    assert (
        np.abs((force[pushed] / np.linalg.norm(force[pushed], axis=1)[:, None]).mean(0)).max() < 0.1
    )
    arm = 0.7 * np.array([0.1, 0.0, 0.5])
    np.testing.assert_allclose(moment, np.cross(arm, force), rtol=1e-4, atol=1e-2)


def test_a_body_is_pushed_within_the_step_and_not_in_an_evaluation():
    character = load_character(PhysicsConfig())
    calm = tiny_task(character, changed())
    pushed = tiny_task(character, changed(push_ns=40.0, push_interval_s=1e-3))
    state = jax.jit(calm.environment.init, static_argnums=2)(calm.world, KEY, 16)
    action = state.action
    still, moved = (
        jax.jit(built.environment.advance)(built.world, state, action)[0].physics.kinematics
        for built in (calm, pushed)
    )
    change = np.asarray(moved.link_linear_velocity - still.link_linear_velocity)[:, 0, :2]
    speed = np.linalg.norm(change, axis=1)
    assert speed.max() < 6.0
    assert np.median(speed) > 0.1
