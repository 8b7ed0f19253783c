from __future__ import annotations

import dataclasses
import io
import tempfile
import zipfile

import numpy as np
import pytest
from edit_samples import whole_motion

from getup_jax.config import PhysicsConfig
from getup_jax.editor import imports
from getup_jax.editor.export import export
from getup_jax.editor.imports import curves_of
from getup_jax.motion.clips import Clip, MotionError
from getup_jax.motion.io.curve_file import dump, parse_text
from getup_jax.motion.retarget.job import run_here
from getup_jax.motion.retarget.subprocess_job import Stop
from getup_jax.physics.character import load_character


@pytest.fixture(scope="module")
def rising(motion, simulator):
    """A motion that lies for a second and rises like a board in two."""
    character = simulator.character
    share = np.clip((np.arange(120) - 30) / 60, 0.0, 1.0)
    pose = np.tile(character.neutral_qpos, (120, 1))
    angle = -(1.0 - share) * np.pi / 2
    pose[:, 3:7] = 0.0
    pose[:, 3], pose[:, 5] = np.cos(angle / 2), np.sin(angle / 2)
    pose[:, 2] = np.maximum(
        0.12, character.neutral_qpos[2] - 0.84 * (1 - np.sin(share * np.pi / 2))
    )
    frames = dataclasses.replace(
        motion.frames, qpos=pose.astype(np.float32), features=np.zeros((120, 3), np.float32)
    )
    return dataclasses.replace(motion, frames=frames)


def test_a_clip_gives_its_curve_and_a_start_pose_that_a_file_keeps(rising, simulator):
    content = export(rising, simulator.character, "npz")
    (curve,) = curves_of("board (1).npz", content, simulator.character)
    assert curve.pose is not None
    assert curve.values[0, 2] == pytest.approx(0.0, abs=3.0)  # degrees: on its back
    assert curve.values[-1, 2] == pytest.approx(85.0, abs=15.0)  # the cut ends almost upright
    again = parse_text(dump(curve), "file")
    assert again.plain() == curve.plain()
    np.testing.assert_array_equal(again.start_clip({}, simulator.character).qpos[0], curve.pose)
    assert simulator.starts.gap(curve) < 0.1
    start = whole_motion(simulator, curve).frames.features[0]
    assert np.degrees(start[2]) == pytest.approx(0.0, abs=15.0)


def test_what_holds_no_get_up_is_refused_with_a_reason(rising, motion, simulator):
    still = dataclasses.replace(rising.frames, qpos=np.tile(rising.frames.qpos[:1], (60, 1)))
    content = export(dataclasses.replace(rising, frames=still), simulator.character, "npz")
    with pytest.raises(
        MotionError, match=r"still\.npz: no get-up in 2 s; expected a body that lies"
    ):
        curves_of("still.npz", content, simulator.character)
    with pytest.raises(
        MotionError, match=r"bomb\.npz: expected at most 256 MB unpacked, got 300 MB"
    ):
        curves_of("bomb.npz", _packed_zeros(300_000_000), simulator.character)
    with pytest.raises(MotionError, match=r"take\.fbx: expected a file that ends in \.bvh"):
        curves_of("take.fbx", b"", simulator.character)


def _packed_zeros(size: int) -> bytes:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as file:
        file.writestr("qpos.npy", bytes(size))
    return packed.getvalue()


@pytest.fixture(scope="module")
def character():
    return load_character(PhysicsConfig())


def an_array_of_40_tb() -> bytes:
    """A clip's file whose qpos declares ten million million numbers, and has none."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as file:
        for name in ("qpos", "fps", "name", "source", "joints", "report"):
            text = "{'descr': '<f4', 'fortran_order': False, 'shape': (10000000000000,)}".ljust(117)
            head = b"\x93NUMPY\x01\x00" + (118).to_bytes(2, "little") + text.encode() + b"\n"
            file.writestr(f"{name}.npy", head)
    return packed.getvalue()


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.npz", an_array_of_40_tb()),
        ("a.npz", b"PK\x03\x04"),
        ("take (1).json", b"[" * 100_000),
        ("take (1).json", b'{"fps": ' + b"9" * 5000 + b', "frames": [{}]}'),
        ("take (1).txt", b'{"Frames": [[' + b"1e308," * 43 + b"1e308]]}"),
        ("take (1).txt", b'{"Frames": [[' + b"9" * 400 + b"]]}"),
        ("take (1).bvh", b"HIERARCHY\nROOT a\n"),
        ("take (1).bvh", b"\xff\xfe\x00"),
        ("a b+c-d.bvh", b""),
        ("\U0001d400" * 96 + ".bvh", b"x"),
        ("\U0001d400" * 96 + ".npz", b"x"),
        (".bvh.bvh", b"x"),
    ],
)
def test_what_is_said_of_a_file_names_it_and_no_other_path(character, monkeypatch, name, content):
    monkeypatch.setattr(imports, "run_apart", lambda job, stop, memory: run_here(job))
    with pytest.raises(MotionError) as caught:
        curves_of(name, content, character)
    text = str(caught.value)
    assert text.startswith(name)
    assert tempfile.gettempdir() not in text
    assert "\n" not in text
    assert len(text) < 700


def test_a_worker_gets_its_limits_and_what_it_says_loses_the_folder(character, monkeypatch):
    given = []

    def fail(job, stop, memory):
        given.append((stop, memory))
        raise MotionError(f"{job.path}: cannot be read in {job.path.parent}/x, {job.path.name}")

    monkeypatch.setattr(imports, "run_apart", fail)
    stop = Stop()
    with pytest.raises(MotionError, match=r"^my \(1\)\.bvh: cannot be read in x, my \(1\)\.bvh$"):
        curves_of("my (1).bvh", b"HIERARCHY", character, stop)
    assert given == [(stop, 4_000_000_000)]


def test_a_recording_of_hours_is_refused_before_it_is_searched(character, monkeypatch):
    clip = Clip("long", 30.0, np.tile(character.neutral_qpos, (11, 1)))
    monkeypatch.setattr(imports, "_MOST_FRAMES", 10)
    monkeypatch.setattr(imports, "_retargeted", lambda *_: clip)
    monkeypatch.setattr(imports, "find_getups", lambda *_: pytest.fail("searched"))
    with pytest.raises(MotionError, match=r"a\.bvh: expected at most 10 frames, got 11; cut it"):
        curves_of("a.bvh", b"", character)


def test_a_disk_that_is_full_is_said_in_one_line(character, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device", "/tmp/x/a.bvh")

    monkeypatch.setattr(imports.Path, "write_bytes", full)
    with pytest.raises(MotionError, match=r"^a\.bvh: cannot be read: No space left on device$"):
        curves_of("a.bvh", b"", character)


@pytest.mark.slow
def test_a_bvh_file_is_retargeted_in_a_process_of_its_own(simulator):
    with pytest.raises(MotionError, match=r"a\.bvh"):
        curves_of("a.bvh", b"\x00\x01", simulator.character)
