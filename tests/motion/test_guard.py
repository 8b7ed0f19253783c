from __future__ import annotations

import json

import numpy as np
import pytest

from getup_jax.config import ConfigError
from getup_jax.motion.clips import MotionError
from getup_jax.motion.io import readers
from getup_jax.motion.io.guard import one_line
from getup_jax.motion.io.readers import SUFFIXES, read_motion


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (KeyError("/tmp/x"), r"a\.bvh: expected a motion, .* \(KeyError\); export it again"),
        (np.linalg.LinAlgError("SVD"), r"a\.bvh: expected a motion, .* \(LinAlgError\)"),
        (MemoryError("40 TiB"), r"a\.bvh: needs more memory than there is"),
        (RecursionError("depth"), r"a\.bvh: .* lists within lists too deep"),
        (OSError(5, "Input/output error", "/tmp/x"), r"a\.bvh: cannot be read: Input/output error"),
        (OSError("/tmp/x"), r"a\.bvh: cannot be read: OSError"),
    ],
)
def test_what_nobody_foresaw_is_one_line_without_a_path(error, text):
    with pytest.raises(MotionError, match=text) as caught, one_line("a.bvh"):
        raise error
    assert "/tmp" not in str(caught.value)
    assert caught.value.__cause__ is error


@pytest.mark.parametrize("error", [MotionError("ours"), ConfigError("ours"), KeyboardInterrupt()])
def test_our_own_errors_and_the_end_of_the_program_pass(error):
    with pytest.raises(type(error)) as caught, one_line("a.bvh"):
        raise error
    assert caught.value is error


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_every_reader_is_guarded(tmp_path, monkeypatch, suffix):
    def fail(*_):
        raise ZeroDivisionError("/tmp/x")

    monkeypatch.setattr(readers.bvh, "read_bvh", fail)
    monkeypatch.setattr(readers.asf_amc, "read_amc", fail)
    monkeypatch.setattr(readers, "_read_json", fail)
    file = tmp_path / f"a{suffix}"
    file.touch()
    with pytest.raises(MotionError, match=rf"^a\{suffix}: expected a motion") as caught:
        read_motion(file)
    assert str(tmp_path) not in str(caught.value)


DEEPMIMIC = [0.05, 0.0, 0.9, 0.0, *[1.0, 0, 0, 0] * 4, 0.0, *[1.0, 0, 0, 0] * 2, 0.0]
DEEPMIMIC += [*[1.0, 0, 0, 0], 0.0, *[1.0, 0, 0, 0] * 2, 0.0]
BODIES = {"pelvis": [[0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0]], "torso": [0.0, 0.0, 0.0, 1.0]}
DEEP = json.loads("[" * 400 + "]" * 400)
# what JSON can hold that is no number of a motion; the first two are not JSON's own words
WRONG = [
    "NaN",
    "Infinity",
    "1e308",
    "1e999",
    "-1e308",
    "9" * 400,
    "9" * 5000,
    "null",
    "[]",
    "{}",
    '"x"',
]
WRONG += ['"\\ud800"', '"' + "x" * 9999 + '"', json.dumps(DEEP), "[" * 50_000, '{"a": 1}']


@pytest.mark.parametrize("value", WRONG, ids=lambda text: text[:9])
@pytest.mark.parametrize("name", ["a.txt", "b.json"])
def test_no_value_in_a_json_motion_ends_in_pythons_words(tmp_path, name, value):
    file, frame = tmp_path / name, DEEPMIMIC
    for place in range(6):
        frames = [[*frame[:place], "HERE", *frame[place + 1 :]], frame, frame]
        bodies = [{**BODIES, "pelvis": [["HERE", 0, 0], BODIES["pelvis"][1]]}, "HERE"]
        bodies = [
            {"fps": "HERE", "frames": [BODIES]},
            *({"fps": 30, "frames": [b]} for b in bodies),
        ]
        content = {"Loop": "none", "Frames": frames} if name == "a.txt" else bodies[place % 3]
        file.write_text(json.dumps(content).replace('"HERE"', value))
        with pytest.raises(MotionError, match=rf"^{name}") as caught:
            read_motion(file)
        text = str(caught.value)
        assert len(text) < 400
        assert "\n" not in text
        cause = caught.value.__cause__
        assert cause is None or str(cause) not in text


def test_frames_of_hugely_unequal_duration_are_refused(tmp_path):
    file = tmp_path / "a.txt"
    rows = [[seconds, *DEEPMIMIC[1:]] for seconds in [1e-4] * 12 + [10.0] * 12]
    file.write_text(json.dumps({"Frames": rows}))
    with pytest.raises(MotionError, match="expected less than 1000000 frames at 10000 Hz, got 110"):
        read_motion(file)
