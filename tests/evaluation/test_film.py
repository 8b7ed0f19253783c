from __future__ import annotations

import dataclasses
import sys

import mujoco
import numpy as np
import pytest
from fake_writer import FakeWriter

from eval_samples import make_task, run
from getup_jax.config import ConfigError
from getup_jax.evaluation import film
from getup_jax.evaluation.rollout import Episodes
from getup_jax.evaluation.scenario import Scenario
from getup_jax.motion.clips import GetUp


@pytest.fixture(scope="module")
def episodes() -> Episodes:
    """Standing starts of two styles, two episodes each."""
    return run(make_task(), Scenario(start="standing"), 4)


def with_success(episodes: Episodes, success: list[bool], reward: list[float]) -> Episodes:
    """The same episodes, but these ones succeed, with these mean task rewards."""
    trace = episodes.trace
    last = np.zeros_like(trace.success)
    last[-1] = success
    rewards = np.broadcast_to(np.asarray(reward, np.float32), trace.task_reward.shape)
    trace = trace.replace(success=last, task_reward=rewards, running=np.ones_like(trace.running))
    return Episodes(episodes.task, episodes.plan, trace)


def test_typical_is_a_success_where_there_is_one(episodes):
    # episodes 0 and 2 are of the first style, 1 and 3 of the second
    changed = with_success(episodes, [False, True, True, False], [0.9, 0.5, 0.1, 0.8])
    assert film.typical(changed, 2) == [2, 1]


def test_typical_is_the_median_and_not_the_best(episodes):
    changed = with_success(episodes, [False] * 4, [0.9, 0.1, 0.2, 0.5])
    assert film.typical(changed, 2) == [0, 3]  # of two the upper one
    assert film.typical(changed, 1) == [0]


def test_the_label_names_the_style_its_time_and_the_end(episodes):
    changed = with_success(episodes, [True, False, False, False], [1.0] * 4)
    assert film.label(changed, 0) == "clip, 1.0 s: stands"
    assert film.label(changed, 1) == "curve, 2.0 s: does not stand"


def test_the_caption_writes_on_the_picture():
    image = np.full((100, 200, 3), 200, np.uint8)
    written = film.caption(image, "clip")
    assert written.shape == image.shape
    assert (written[30:] == 200).all()
    assert {0, 255} <= set(np.unique(written[:26]))


@pytest.mark.parametrize("heading", [0.0, 1.0, -2.5])
def test_the_camera_turns_with_the_body(heading):
    lying, standing = np.zeros(56), np.zeros(56)
    turn = np.array([np.cos(heading / 2), 0.0, 0.0, np.sin(heading / 2)])
    half = np.sqrt(0.5)
    mujoco.mju_mulQuat(lying[3:7], turn, np.array([half, 0.0, half, 0.0]))  # the spine along +x
    standing[3:7] = turn
    for pose in (lying, standing):
        got = np.radians(film.view(pose)) - np.radians(120.0) - heading
        assert np.cos(got) == pytest.approx(1.0)


def can_render(episodes: Episodes) -> bool:
    try:
        film.render(episodes.task.environment.character.model, episodes.trace.qpos[:1, 0], (8, 8))
    except ConfigError:
        return False
    return True


def test_a_film_has_the_frames_at_the_rate_of_the_policy(episodes, monkeypatch, tmp_path):
    writer = FakeWriter()
    monkeypatch.setattr(film, "require", lambda: writer)
    monkeypatch.setattr(
        film, "render", lambda model, qpos, size: [np.zeros((*size, 3), np.uint8)] * len(qpos)
    )
    film.film(tmp_path / "a.mp4", episodes, (48, 64))
    assert {image.shape for image in writer.images} == {(48, 64, 3)}
    assert writer.settings["fps"] == 30
    chosen = film.typical(episodes, film.STYLES)
    steps = int(episodes.trace.running[:, chosen].sum())
    assert len(writer.images) == steps + 15 * len(
        chosen
    )  # the last picture stays for half a second


def test_pictures_show_the_body(episodes):
    if not can_render(episodes):
        pytest.skip("this machine cannot render")
    model = episodes.task.environment.character.model
    image, other = film.render(model, episodes.trace.qpos[:2, 0], (60, 80))
    assert image.shape == (60, 80, 3)
    assert image.std() > 5
    away = episodes.trace.qpos[:1, 0].copy()
    away[:, 2] += 50.0
    (empty,) = film.render(model, away, (60, 80))
    assert np.abs(image.astype(int) - empty).max() > 30
    assert np.abs(image.astype(int) - other).mean() < 5


def test_a_real_film(episodes, tmp_path):
    imageio = pytest.importorskip("imageio.v2")
    pytest.importorskip("imageio_ffmpeg")
    if not can_render(episodes):
        pytest.skip("this machine cannot render")
    file = tmp_path / "a.mp4"
    film.film(file, episodes, (240, 320))
    with imageio.get_reader(file) as reader:
        assert reader.get_meta_data()["fps"] == 30
        assert reader.get_meta_data()["size"] == (320, 240)


def test_a_picture_of_a_films_own_size(episodes):
    """Larger than what MuJoCo renders unless it is told."""
    if not can_render(episodes):
        pytest.skip("this machine cannot render")
    model = episodes.task.environment.character.model
    (image,) = film.render(model, episodes.trace.qpos[:1, 0], film.FILM_SIZE)
    assert image.shape == (720, 1280, 3)
    assert image.std() > 5


def test_without_imageio_the_error_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio.v2", None)
    with pytest.raises(ConfigError, match=r"pip install 'getup-jax\[video\]'"):
        film.require()


def test_without_a_renderer_the_error_says_what_to_set(episodes, monkeypatch):
    def fail(*_):
        raise RuntimeError("no display")

    tries = []
    monkeypatch.setattr(mujoco, "Renderer", lambda *_: tries.append(1) or fail())
    monkeypatch.setattr(film, "_failures", [])
    with pytest.raises(ConfigError, match=r"no display.*MUJOCO_GL=egl"):
        film.render(episodes.task.environment.character.model, episodes.trace.qpos[:1, 0])
    with pytest.raises(ConfigError, match="no display"):
        film.render(episodes.task.environment.character.model, episodes.trace.qpos[:1, 0])
    assert len(tries) == 1  # a second try would abort Python where GLFW has failed


def test_styles_are_spread_over_all_of_them(episodes):
    styles = tuple(GetUp(str(i), 1.0, np.zeros((9, 3))) for i in range(4))
    task = dataclasses.replace(episodes.task, getups=styles)
    plan = dataclasses.replace(episodes.plan, getup=np.arange(4))
    assert film.typical(Episodes(task, plan, episodes.trace), 2) == [0, 3]
