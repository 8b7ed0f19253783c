"""Irregular ground in the page, in headless Chromium."""

from __future__ import annotations

import numpy as np
import pytest
from browser import BROWSER, achieved, edited, opened, picture, saved, served, shot
from edit_samples import save_ground_policy
from ground_samples import TERRAIN

from getup_jax.motion.io.curve_file import read_curve_file
from getup_jax.physics.terrain_map import REGIONS

pytestmark = BROWSER


@pytest.fixture(scope="module")
def ground_server(tmp_path_factory):
    pytest.importorskip("playwright", reason="needs pip install 'getup-jax[browser]'")
    run = save_ground_policy(tmp_path_factory.mktemp("ground"), TERRAIN)
    with served("--port", "0", "--ckpt", str(run)) as running:
        yield running


def test_a_region_and_a_place_in_it_can_be_chosen(ground_server):
    def stop_at(share: float):
        page.locator("#scrub").fill(str(share))
        page.wait_for_timeout(1500)  # the camera follows
        return picture(page, "#view")

    with opened(ground_server[0]) as page:
        assert page.locator("#region option").all_inner_texts() == list(REGIONS)
        edited(page, lambda: page.select_option("#curve", label="supine_quadruped_right"))
        flat, lines = stop_at(0.0), {achieved(page)}
        edited(page, lambda: page.select_option("#region", label="hard"))
        hard = stop_at(0.0)
        shot(page, "ground_hard")
        below = slice(int(0.75 * len(flat)), None)  # the body lies higher in the picture
        changed = np.abs(hard[below] - flat[below]).max(axis=2) > 0.02
        assert changed.mean() > 0.2, "the ground of the region is not drawn"
        lines.add(achieved(page))
        for place in ("2", "3"):
            edited(page, lambda to=place: fill(page, to))
            lines.add(achieved(page))
        assert len(lines) == 4, "two places gave the same motion"
        stop_at(1.0)
        shot(page, "ground_end")
        start = page.input_value("#start")
        edited(page, lambda: page.keyboard.press("Control+z"))
        assert (page.input_value("#place"), page.input_value("#start")) == ("2", start)
        fill(page, "99")
        assert page.input_value("#place") == page.get_attribute("#place", "max")


def test_region_and_place_are_kept_in_the_file_and_in_the_project(ground_server, tmp_path):
    with opened(ground_server[0], accept_downloads=True) as page:
        edited(page, lambda: page.select_option("#curve", label="supine_quadruped_right"))
        edited(page, lambda: page.select_option("#region", label="hard"))
        edited(page, lambda: fill(page, "3"))
        file, line = saved(page, "#save", tmp_path), achieved(page)
        assert read_curve_file(file).ground == ("hard", 3)
        page.wait_for_timeout(300)
        page.wait_for_selector("body[data-saved]")
        page.reload()
        page.wait_for_selector("body[data-shown]")
        assert (page.input_value("#region"), page.input_value("#place")) == ("3", "3")
        edited(page, lambda: page.select_option("#region", label="flat"))
        edited(page, lambda: page.set_input_files("#file-curve", str(file)))
        assert (page.input_value("#region"), page.input_value("#place")) == ("3", "3")
        assert achieved(page) == line


def fill(page, place: str) -> None:
    page.fill("#place", place)
    page.press("#place", "Enter")
