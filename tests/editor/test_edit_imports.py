from __future__ import annotations

import dataclasses
import io
import zipfile

import numpy as np
import pytest

from getup_jax.editor.export import export
from getup_jax.editor.imports import curves_of
from getup_jax.motion.clips import MotionError
from getup_jax.motion.curve_file import dump, parse_text


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
    start = simulator.finish(curve).frames.features[0]
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


@pytest.mark.slow
def test_a_bvh_file_is_retargeted_in_a_process_of_its_own(simulator):
    with pytest.raises(MotionError, match=r"a\.bvh"):
        curves_of("a.bvh", b"\x00\x01", simulator.character)
