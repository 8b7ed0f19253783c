from __future__ import annotations

import sys

import numpy as np
import pytest

from eval_samples import make_task, run
from getup_jax.config import ConfigError
from getup_jax.evaluation import film, plot
from getup_jax.evaluation.rollout import Episodes
from getup_jax.evaluation.scenario import Scenario


@pytest.fixture(scope="module")
def episodes() -> Episodes:
    return run(make_task(), Scenario(start="standing"), 3)


def test_the_band_is_over_the_episodes_that_run():
    features = np.zeros((4, 2, 3))
    features[:, :, 0] = [[1.0, 3.0], [2.0, 4.0], [5.0, 99.0], [99.0, 99.0]]
    running = np.array([[1, 1], [1, 1], [1, 0], [0, 0]], bool)
    mean, low, high, left = plot.band(features, running)
    np.testing.assert_allclose(mean[:, 0], [2.0, 3.0, 5.0])
    np.testing.assert_allclose(low[:, 0], [1.2, 2.2, 5.0])
    np.testing.assert_allclose(high[:, 0], [2.8, 3.8, 5.0])
    assert left.tolist() == [2, 2, 1]


def fake_render(model, qpos, size):
    return [np.zeros((*size, 3), np.uint8)] * len(qpos)


def drawn(episodes, tmp_path, monkeypatch):
    """The figure that `plot` saves."""
    pytest.importorskip("matplotlib")
    pyplot = plot.require()
    figures = []
    monkeypatch.setattr(pyplot, "close", figures.append)
    file = tmp_path / "a.png"
    plot.plot(file, episodes)
    monkeypatch.undo()
    assert file.read_bytes()[1:4] == b"PNG"
    pyplot.close(figures[0])
    return figures[0]


def test_a_column_a_style_with_target_achieved_and_pictures(episodes, tmp_path, monkeypatch):
    monkeypatch.setattr(plot, "render", fake_render)
    figure = drawn(episodes, tmp_path, monkeypatch)
    assert len(figure.axes) == 4 * 2
    for column, style in enumerate(episodes.styles):
        height, _, front, strip = figure.axes[column::2]
        assert height.get_title().startswith(f"{style.name}\n")
        achieved, target, _ = height.get_lines()
        of_style = episodes.getup == column
        expected = episodes.trace.features[0, of_style, 0].mean()
        assert achieved.get_ydata()[0] == pytest.approx(expected, rel=1e-5)
        assert target.get_ydata()[-1] == pytest.approx(style.points[-1, 0], rel=1e-5)
        front_target = front.get_lines()[1].get_ydata()[-1]
        assert front_target == pytest.approx(np.degrees(style.points[-1, 2]), rel=1e-4)
        assert len(strip.get_images()) == 1


def test_without_a_renderer_the_pictures_are_left_out(episodes, tmp_path, monkeypatch):
    monkeypatch.setattr(film, "_failures", ["no display"])
    with pytest.warns(RuntimeWarning, match="--plot: without pictures: cannot render"):
        figure = drawn(episodes, tmp_path, monkeypatch)
    assert len(figure.axes) == 3 * 2


def test_without_matplotlib_the_error_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(ConfigError, match=r"pip install 'getup-jax\[plot\]'"):
        plot.require()
