"""Files that the page writes and reads, in headless Chromium, with the shipped policy."""

from __future__ import annotations

import importlib.util
import json

import jax.numpy as jnp
import numpy as np
import pytest
from browser import (
    BROWSER,
    HEIGHT,
    drag,
    edited,
    new_project,
    opened,
    picture,
    saved,
    says,
    shot,
    value,
)
from glb_reading import link_places, read_glb
from matplotlib.image import imread

from getup_jax.cli import main
from getup_jax.motion.getup import curves
from getup_jax.motion.io.bvh import read_bvh
from getup_jax.motion.io.curve_file import read_curve_file
from getup_jax.motion.io.recording import forward, scaled

JUDGED = """count => [...document.querySelectorAll('#curve optgroup[label=imported] option')]
  .filter((option) => /[✓≈✗]/.test(option.textContent)).length === count"""
MILLIMETRE = 0.001

pytestmark = BROWSER


def test_what_is_saved_opens_again_and_evaluates_the_same(page_server, tmp_path):
    with opened(page_server[0], accept_downloads=True) as page:
        page.fill("#name", "my_rise")
        edited(page, lambda: drag(page, HEIGHT, 5, -25))
        file = saved(page, "#save", tmp_path)
        scores, moved = page.inner_text("#scores"), value(page, HEIGHT, 5)
        verdict = page.inner_text("#verdict")
        edited(page, lambda: new_project(page))
        assert value(page, HEIGHT, 5) != moved
        edited(page, lambda: page.set_input_files("#file-curve", str(file)))
        assert value(page, HEIGHT, 5) == pytest.approx(moved, abs=2e-3)
        assert page.inner_text("#scores") == scores
    height = curve_at(read_curve_file(file), 5 / 8)
    assert height == pytest.approx(moved, abs=2e-3)
    out = tmp_path / "out.json"
    assert main.eval_main(["--curves", str(file), "--json", str(out)]) == 0
    found = json.loads(out.read_text())
    assert found["success"] == float(verdict.startswith("Stands"))
    assert f"height error {found['height_error_m']:.3f} m" in scores
    assert f"angle error {np.degrees(found['angle_error_rad']):.1f}°" in scores
    assert f"return rate {found['return_rate']:.2f}" in scores
    assert f"energy {found['energy_j']:.0f} J" in scores
    assert f"jitter {found['jitter']:.0f} rad/s³" in scores


def curve_at(curve, share: float) -> float:
    """Height (m) of the curve at a share of its duration."""
    return float(curves.evaluate(jnp.asarray(curve.values), jnp.asarray([share]))[0, 0])


def test_exports_hold_the_motion_that_is_shown(page_server, tmp_path):
    glb = importlib.util.find_spec("pygltflib") is not None  # the extra `glb`
    with opened(page_server[0], accept_downloads=True) as page:
        edited(page, lambda: drag(page, HEIGHT, 4, -20))
        kinds = ("bvh", "npz", "csv", *(("glb",) if glb else ()), "png")
        files = {kind: saved(page, kind, tmp_path) for kind in kinds}
        seconds = float(page.input_value("#seconds"))
        rise = saved(page, "bvh", tmp_path / "rise", part="rise", rate="60")
        page.wait_for_timeout(300)
        assert np.ptp(picture(page, "#view")) > 0.3, "the view is empty after the picture"
    still = imread(files["png"])
    assert still.shape[:2] == (1080, 1920)
    assert np.ptp(still[..., :3]) > 0.3, "the picture is empty"
    without = read_bvh(rise)
    assert without.fps == pytest.approx(60, rel=1e-5)
    assert without.num_frames == int(60 * seconds + 1e-6) + 1  # no standing at the end
    recording = scaled(read_bvh(files["bvh"]), 0.01)
    with np.load(files["npz"]) as data:
        links = data["link_position"]
        names = [str(name) for name in data["links"]]
    position, _ = forward(recording)
    order = [recording.joint(name) for name in names]
    # the quarter turn that makes the rest pose face +Z in the file
    wanted = links[..., [1, 0, 2]] * [1.0, -1.0, 1.0]
    assert np.abs(position[1:, order] - wanted).max() < MILLIMETRE  # the first is at 0 s
    assert len(files["csv"].read_text().splitlines()) == recording.num_frames
    if glb:
        places = link_places(read_glb(files["glb"].read_bytes()))
        found = np.stack([places[name][1:] for name in names], axis=1)
        assert np.abs(found - links).max() < MILLIMETRE


def test_a_motion_file_gives_its_curve_and_start_pose(page_server, tmp_path):
    with opened(page_server[0], accept_downloads=True) as page:
        assert page.inner_text("#verdict").startswith("Stands")
        file = saved(page, "bvh", tmp_path)
        edited(page, lambda: page.set_input_files("#file-motion", str(file)))
        page.wait_for_function(
            "name => document.getElementById('toast').textContent.includes(name)", arg=file.name
        )
        name = page.input_value("#name")
        assert name in page.inner_text("#curve optgroup[label=imported]")
        assert page.input_value("#start") == name
        page.check("#source")
        page.wait_for_selector(".recorded")
        page.wait_for_timeout(1000)
        assert value(page, HEIGHT, 8) > 1.2
        assert "starts" not in page.inner_text("#scores"), "the pose does not fit its own curve"
        page.wait_for_timeout(2000)
        shot(page, "imported")
        assert read_curve_file(saved(page, "#save", tmp_path)).pose is not None


def test_a_batch_of_imports_can_be_cancelled(page_server, tmp_path):
    with opened(page_server[0], accept_downloads=True) as page:
        file = saved(page, "bvh", tmp_path)
        # another motion each, so that no cache has it
        text = file.read_text()
        batch = [tmp_path / f"take_{i}.bvh" for i in range(3)]
        head, tail = text.split("Frame Time: ")
        seconds, frames = tail.split("\n", 1)
        for i, take in enumerate(batch):
            take.write_text(f"{head}Frame Time: {float(seconds) * (1 + 0.01 * i)}\n{frames}")
        page.set_input_files("#file-motion", [str(take) for take in batch])
        page.click("#toast button")
        says(page, "toast", "take_0.bvh: not imported, nor the 2 after it: cancelled")
        imported = page.locator("#curve optgroup[label=imported] option")
        page.set_input_files("#file-motion", str(batch[2]))
        page.wait_for_function(JUDGED, arg=1)
        assert imported.count() == 1
        assert "take_2" in imported.first.inner_text()


def test_what_was_imported_is_judged_one_by_one(page_server, tmp_path):
    with opened(page_server[0], accept_downloads=True) as page:
        stands = saved(page, "npz", tmp_path)
        other = stands.with_name("other take.npz")
        other.write_bytes(stands.read_bytes())
        page.set_input_files("#file-motion", [str(stands), str(other)])
        imported = page.locator("#curve optgroup[label=imported] option")
        page.wait_for_function(JUDGED, arg=2)
        for file, text in zip((stands, other), imported.all_inner_texts(), strict=True):
            assert f"({file.name}, " in text
            assert "✓ stands after" in text
        kept = page.locator("body[data-saved]")
        kept.wait_for()
        page.reload()
        page.wait_for_selector("body[data-shown]")
        page.wait_for_function(JUDGED, arg=2)  # a project's, when it is opened


@pytest.mark.filterwarnings("ignore:os.fork")  # of the reader's own ffmpeg
def test_a_film_is_large_says_how_far_it_is_and_can_be_cancelled(page_server, tmp_path):
    imageio = pytest.importorskip("imageio.v2", reason="needs pip install 'getup-jax[video]'")
    with opened(page_server[0], accept_downloads=True) as page:
        page.click("#export")
        page.select_option("#format", "mp4")
        page.click("#export-go")
        page.wait_for_function(
            "() => document.getElementById('export-progress').value > 0.02", timeout=60_000
        )
        shot(page, "film")
        page.click("#export-cancel")
        says(page, "toast", "cancelled")
        assert not page.locator("#dialog").evaluate("dialog => dialog.open")
        page.locator("#scrub").fill("0.04")
        page.click("#out")
        file = saved(page, "mp4", tmp_path, part="range")
    with imageio.get_reader(file) as film:
        assert film.get_meta_data()["fps"] == 30
        assert film.get_data(0).shape == (1080, 1920, 3)
        assert 5 <= film.count_frames() <= 10  # a twenty-fifth of 6.4 s


_NO_WEBGL = """
const context = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
  return kind.startsWith("webgl") ? null : context.call(this, kind, ...more);
};
"""


def test_without_webgl_a_picture_is_refused_with_a_reason_and_all_else_works(page_server, tmp_path):
    with opened(page_server[0], script=_NO_WEBGL) as page:
        says(page, "veil", "no WebGL")
        page.click("text=+ variant")
        edited(page, lambda: drag(page, HEIGHT, 4, 20))
        page.click("#export")
        page.select_option("#format", "png")
        page.click("#export-go")
        says(page, "toast", "There is no picture: this browser draws no 3-D view")
        page.click("#export-cancel")
        name = page.input_value("#name")
        assert saved(page, "csv", tmp_path).name == f"{name}_B.csv"
        assert saved(page, "#save", tmp_path).name == f"{name}_B.yaml"


def test_a_file_that_is_no_curve_file_is_refused_with_a_reason(page_server, tmp_path):
    bad = tmp_path / "bad.yaml"
    bad.write_text("height: [1, 2]\n")
    with opened(page_server[0]) as page:
        page.set_input_files("#file-curve", str(bad))
        page.wait_for_selector("#toast.bad")
        assert "bad.yaml: expected the keys name" in page.inner_text("#toast")
