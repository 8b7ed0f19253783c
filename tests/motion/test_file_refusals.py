"""Files that cannot be right: one clear line, soon, and no clip."""

from __future__ import annotations

import random
import re

import numpy as np
import pytest
from bvh_samples import (
    BASE,
    FRAMES,
    HEADER,
    ROWS,
    body_of,
    human_bvh,
    imported,
    write,
)

from getup_jax.motion.clips import MotionError
from getup_jax.motion.io.readers import read_motion


def zero(*names):
    return human_bvh(dict.fromkeys(names, (0.0, 0.0, 0.0)))


REFUSED = {
    "milliseconds": (
        BASE.replace("0.0333333", "33.333"),
        r"take\.bvh, line 134: a frame time of 33\.333 s is not possible; milliseconds\? then give "
        r"--source-fps 30$",
    ),
    "frames a second": (
        BASE.replace("0.0333333", "30"),
        r"30 s is not possible; milliseconds\? .*; frames a second\? then give --source-fps 30$",
    ),
    "microseconds": (BASE.replace("0.0333333", "33333"), r"not possible; give .* --source-fps"),
    "too short a frame": (BASE.replace("0.0333333", "1e-9"), r"not possible; give .* --source-fps"),
    "no time": (BASE.replace("0.0333333", "0"), r"expected a frame time above 0 s, got 0;"),
    "time backwards": (BASE.replace("0.0333333", "-1"), r"expected a frame time above 0 s, got -1"),
    "no frame time": (BASE.replace("Frame Time: 0.0333333\n", ""), r"'Frame Time:'.*--source-fps"),
    "decimal commas": (
        re.sub(r"(\d)\.(\d)", r"\1,\2", BASE),
        r"line 4: OFFSET: .* got '0,000000'; decimals take a point, not a comma",
    ),
    "numbers glued together": (
        BASE.replace("12.000000 0.0", "12.0000000.0", 1),
        r"line 12: OFFSET",
    ),
    "values glued together": (
        BASE.removesuffix(ROWS) + ROWS.replace("0.000000 12.000000", "0.00000012.000000", 1),
        r"line 135: expected 69 values, one a channel, got 68; the row is damaged",
    ),
    "no rows": (BASE.removesuffix(ROWS).replace(f"Frames: {FRAMES}", "Frames: 0"), "at least one"),
    "no rows, though it says some": (BASE.removesuffix(ROWS), "says 10 frames, file has 0 rows"),
    "10^12 frames": (BASE.replace(f"Frames: {FRAMES}", f"Frames: {10**12}"), "file has 10 rows"),
    "a number past all numbers": (
        BASE.replace("95.000000", "1e308"),
        "expected a finite number of at most 1e.09, got",
    ),
    "an underscore in a number": (
        BASE.replace("95.000000", "9_5"),
        "finite number of at most 1e.09, got '9_5'",
    ),
    "no channels": (re.sub(r"CHANNELS.*", "CHANNELS 0", BASE), "expected joints with CHANNELS"),
    "a channel twice": (BASE.replace("3 Zrot", "3 Yrot"), r"Spine: twice the channel 'Yrotation'"),
    "no brace": (BASE.replace("{", "", 1), "line 4: expected an opening brace before OFFSET"),
    "an open brace": (BASE.replace("}\n", "", 1), "1 braces are still open"),
    "no numbers": (BASE.replace("OFFSET 0.000000 10.000000 0.000000", "OFFSET"), "Spine: OFFSET:"),
    "a zip archive": (b"PK\x03\x04" + bytes(100), "got a zip archive; unpack it"),
    "a web page": ("<!doctype html>\n<html></html>", "got a web page; download the file itself"),
    "binary data": (bytes(range(256)) * 9, "expected a text file, got binary data"),
    "nothing": ("", "expected HIERARCHY, got nothing"),
    "all bones without length": (
        zero(*(name for name in ("Spine", "LeftUpLeg", "RightUpLeg", "LeftLeg", "RightLeg")))
        .replace("-41.000000", "0")
        .replace("-6.000000 13.000000", "0 0"),
        "joints LeftUpLeg and RightUpLeg are at one place .*; all bones of the legs are without",
    ),
    "hips of no width": (
        zero("LeftUpLeg", "RightUpLeg"),
        "joints LeftUpLeg and RightUpLeg are at one place in the file's skeleton; give",
    ),
    "a leg of no length": (
        zero("LeftLeg", "LeftFoot"),
        "joints LeftUpLeg, LeftLeg and LeftFoot are at one place",
    ),
    "a joint named twice that a link needs": (
        BASE.replace("JOINT RightArm", "JOINT LeftArm"),
        "joint LeftArm appears twice, and arm_l needs it; rename one|no joint found for arm_r",
    ),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_a_file_that_cannot_be_right_is_one_clear_line(tmp_path, character, cache, kind, capsys):
    content, message = REFUSED[kind]
    code, clip, entry = imported(tmp_path, character, content)
    assert (code, clip, entry["frames"]) == (1, None, 0)
    (error,) = entry["errors"]
    assert re.search(message, error), error
    assert "\n" not in error
    assert "Traceback" not in capsys.readouterr().out


def test_a_rate_given_by_hand_takes_the_place_of_a_wrong_one(tmp_path, character, cache):
    _, base, _ = imported(tmp_path, character, BASE)
    for wrong in ("33.333", "0", "nonsense"):
        content = BASE.replace("0.0333333", wrong)
        code, clip, _ = imported(tmp_path, character, content, "--source-fps", "30")
        assert code == 0
        np.testing.assert_allclose(clip.qpos, base.qpos, atol=1e-4)


@pytest.mark.parametrize("nested", [True, False])
def test_a_million_joints_are_one_line_soon(tmp_path, nested):
    joints = "JOINT a\n{\n" if nested else "JOINT a\n{\n}\n"
    file = write(tmp_path, "HIERARCHY\nROOT a\n{\n" + 900_000 * joints)
    with pytest.raises(MotionError, match="expected at most 2000 joints, got more"):
        read_motion(file)


def test_random_damage_is_read_or_refused_in_one_line(tmp_path):
    rng, junk = random.Random(0), [b"{", b"}", b"\n", b"ROOT x\n", b"CHANNELS 1 Xrotation", b"\0"]
    refused = []
    for _ in range(150):
        content = bytearray(BASE.encode())
        for _ in range(rng.choice([1, 2, 20])):
            at = rng.randrange(len(content) if rng.random() < 0.3 else len(HEADER))
            content[at : at + rng.choice([0, 1, 60])] = rng.choice([*junk, rng.randbytes(2)])
        try:
            body_of(write(tmp_path, bytes(content)))
        except MotionError as error:
            refused.append(str(error))
    assert 0 < len(refused) < 150
    assert not [text for text in refused if "\n" in text]
