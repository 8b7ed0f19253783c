"""A film of composite motion shows the targets of its goals."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from fake_writer import FakeWriter
from tiny_composite import COMPOSITE, clips

from getup_jax.config import ConfigError, PhysicsConfig
from getup_jax.core.types import Kinematics
from getup_jax.envs.composite.build import BuiltComposite
from getup_jax.envs.composite.goals import make_goals
from getup_jax.envs.composite.goals.target_location import LocationState
from getup_jax.envs.composite.task import CompositeTask
from getup_jax.evaluation import composite_film
from getup_jax.evaluation import film as video
from getup_jax.evaluation.composite_rollout import CompositeEpisodes, Shown
from getup_jax.physics.character import load_character

FRAMES = 3


class FakeEngine:
    """Only its rate is asked for."""

    control_dt = 1 / 30


@pytest.fixture(scope="module")
def built() -> BuiltComposite:
    character = load_character(PhysicsConfig(character="humanoid28"))
    goals = make_goals({"target_location": {}}, character, FakeEngine.control_dt)
    task = CompositeTask(FakeEngine(), character, COMPOSITE, (), goals)
    return BuiltComposite(task, None, clips(character), None)


def episodes(built: BuiltComposite, place: tuple[float, float]) -> CompositeEpisodes:
    """One episode in the neutral pose, told to be at a place that it reaches in the last step."""
    character = built.environment.character
    links = len(character.link_names)
    shape = (1, FRAMES)
    state = LocationState(
        place=np.tile(np.asarray(place), (*shape, 1)),
        time_left=np.ones(shape),
        reached=np.arange(FRAMES)[None] == FRAMES - 1,
    )
    qpos = np.tile(character.neutral_qpos, (*shape, 1))
    vectors, turns = np.zeros((*shape, links, 3)), np.zeros((*shape, links, 4))
    kinematics = Kinematics(
        qpos, qpos, vectors, turns, vectors, vectors, qpos[..., 7:], np.ones(shape, bool)
    )
    none = np.zeros((*shape, 1))
    return CompositeEpisodes(
        *(vectors, turns, qpos, np.zeros(shape, bool), none, none[0]),
        shown=Shown((state,), kinematics),
    )


def test_markers_follow_the_goals_step_by_step(built):
    (first, *_, last) = composite_film.markers(built.environment, episodes(built, (1.0, 2.0)), 0)
    np.testing.assert_allclose(first[0].position, [1.0, 2.0, 0.0])
    assert first[0].rgba != last[0].rgba  # green once it is reached
    assert jax.tree.leaves(first) == first
    without = CompositeTask(FakeEngine(), built.environment.character, COMPOSITE, ())
    assert composite_film.markers(without, episodes(built, (0.0, 0.0)), 0) is None


def test_a_place_in_sight_is_in_the_picture(built, tmp_path, monkeypatch):
    pictures = []
    for place in ((0.4, 0.0), (500.0, 0.0)):
        writer = FakeWriter()
        monkeypatch.setattr(video, "require", lambda found=writer: found)
        try:
            composite_film.film(tmp_path / "a.mp4", built, episodes(built, place))
        except ConfigError as error:
            pytest.skip(str(error))
        assert len(writer.images) == FRAMES
        pictures.append(np.asarray(writer.images[0], int))
    assert jnp.max(jnp.abs(pictures[0] - pictures[1])) > 50
