"""`getup-motion import` of the whole LAFAN1 folder against a hand-checked list of get-ups.

The takes are retargeted once and then come from the user's cache.
"""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest

from getup_jax.cli.motion import main
from getup_jax.config.load import load_config
from getup_jax.motion.library import load_motions

pytestmark = pytest.mark.slow
TOLERANCE_FRAMES = 15  # .5 s at 30 fps
ENOUGH = 45  # of the 50 listed get-ups


@pytest.fixture(scope="module")
def report(mocap, tmp_path_factory):
    """{file name: its entry in the JSON} of the command without any flag."""
    file = tmp_path_factory.mktemp("import") / "report.json"
    assert main(["import", str(mocap / "lafan1"), "--json", str(file)]) == 0
    return {entry["file"].rpartition("/")[2]: entry for entry in json.loads(file.read_text())}


def matches(event, row):
    both = ((event["start"], row["lie_start"]), (event["end"], row["stand"]))
    return all(abs(found - int(listed)) <= TOLERANCE_FRAMES for found, listed in both)


def test_listed_getups_are_found(mocap, report):
    with (mocap / "lafan1" / "getup_events.csv").open() as stream:
        listed = list(csv.DictReader(stream))
    left = {name: list(entry["events"]) for name, entry in report.items()}
    found = 0
    for row in listed:
        same = [event for event in left[row["file"]] if matches(event, row)]
        if same:
            left[row["file"]].remove(same[0])  # one event stands for one row
            found += 1
    assert len(listed) == 50
    assert found >= ENOUGH


def test_both_defects_of_the_short_take_are_named(report):
    entry = report["fallAndGetUp1_subject1.bvh"]
    text = "\n".join(entry["warnings"])
    assert "header says 5047 frames, file has 5046 rows" in text
    assert "first row is a T-pose" in text
    assert entry["errors"] == []
    assert entry["frames"] == 5046


def test_every_clip_is_close_continuous_and_above_the_floor(report):
    for name, entry in report.items():
        assert entry["position_error_m"] < 0.05, name
        assert entry["jump_rad"] < 0.5, name
        assert entry["penetration_m"] < 0.02, name


def test_the_reference_cuts_of_the_config_end_upright(mocap, character):
    config = load_config("flat_lafan1", [f"motion.source=[{mocap / 'lafan1'}]"])
    getups = load_motions(config.motion, character).getups
    assert len(getups) == 13
    for getup in getups:
        height, _, front = getup.points[-1]
        assert height > 1.33, getup.name
        assert abs(np.degrees(front) - 90) < 15, getup.name
        # one begins on its side, propped on an elbow, with the neck at 0.52 m
        assert getup.points[0, 0] < 0.55, getup.name
