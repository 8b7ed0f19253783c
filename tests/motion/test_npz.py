from __future__ import annotations

import io
import json
import zipfile

import numpy as np
import pytest

from getup_jax.config import PhysicsConfig
from getup_jax.motion.clips import Clip, MotionError
from getup_jax.motion.io.npz import names_in, read_arrays
from getup_jax.motion.retarget.cache import read_npz, write_npz
from getup_jax.motion.retarget.retarget import RetargetReport
from getup_jax.physics.character import load_character

CHARACTER = load_character(PhysicsConfig())
REPORT = RetargetReport(2, 0.0, 0.0, 0.0, 0.0, 0.0, "", (), ("warned",))
QPOS = np.tile(CHARACTER.neutral_qpos, (2, 1)).astype(np.float32)
PLAIN = {"qpos": QPOS, "fps": 30.0, "name": "a", "source": "b", "joints": CHARACTER.joint_names}


def arrays(**changes):
    return {**PLAIN, "report": json.dumps(vars(REPORT)), **changes}


def test_what_is_written_is_read(tmp_path):
    file = tmp_path / "a.npz"
    write_npz(file, Clip("a", 30.0, QPOS, "b"), REPORT, CHARACTER)
    clip, report = read_npz(file, CHARACTER)
    np.testing.assert_array_equal(clip.qpos, QPOS)
    assert (clip.fps, clip.name, clip.source, report) == (30.0, "a", "b", REPORT)


def header(shape: str, descr: str = "'<f4'") -> bytes:
    """The header of an .npy file, as text."""
    text = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}}}".ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text.encode()


def packed(member: bytes, compression: int = zipfile.ZIP_DEFLATED) -> bytes:
    """A clip's file with another qpos."""
    old, new = io.BytesIO(), io.BytesIO()
    np.savez(old, **arrays())
    with zipfile.ZipFile(old) as source, zipfile.ZipFile(new, "w", compression) as target:
        for name in source.namelist():
            target.writestr(name, member if name == "qpos.npy" else source.read(name))
    return new.getvalue()


def test_the_helper_makes_a_clip(tmp_path):
    file = tmp_path / "a.npz"
    file.write_bytes(packed(header(str(QPOS.shape)) + QPOS.tobytes()))
    np.testing.assert_array_equal(read_npz(file, CHARACTER)[0].qpos, QPOS)


@pytest.mark.parametrize(
    "member",
    [
        header("(10000000000000,)"),  # 40 TB
        header("(178571428571, 56)") + QPOS.tobytes(),
        header("(2, 56)"),
        header("(2, 56)") + QPOS.tobytes() + b"more",
        header("(" + "9" * 60 + ",)"),
        header("(-2, 56)") + QPOS.tobytes(),
        header("(-2, -56)") + QPOS.tobytes(),
        header("()"),
        header("None"),
        header("(True, 56)"),
        header("(1.5,)"),
        header("(" * 40 + ")" * 40),
        header("(1,)", "'|O'") + b"12345678",
        header("(1,)", "'<M8[s]'") + b"12345678",
        header("(1,)", "[('a', '<f4')]") + b"1234",
        header("(1,)", "'nonsense'"),
        header("(2, 56)").replace(b"\x01\x00", b"\x03\x00") + QPOS.tobytes(),
        header("(2, 56)")[:20],
        b"\x93NUMPY\x02\x00\xff\xff\xff\xff",
        b"\x93NUMPY",
        b"",
        b"cos\nsystem\n(S'true'\ntR.",
    ],
)
def test_what_is_declared_must_be_there(tmp_path, member):
    file = tmp_path / "a.npz"
    file.write_bytes(packed(member))
    with pytest.raises(MotionError, match=r"not a clip: expected an \.npz file of getup-motion"):
        read_npz(file, CHARACTER)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"qpos": QPOS[:, :-1]}, r"qpos: expected at least 2 rows of 56 numbers, got \(2, 55\)"),
        ({"qpos": QPOS[:1]}, r"qpos: expected at least 2 rows of 56 numbers, got \(1, 56\)"),
        ({"qpos": QPOS[0]}, "qpos: expected at least 2 rows"),
        ({"qpos": QPOS.astype(int)}, "qpos: expected .* of int64"),
        ({"qpos": QPOS.astype(str)}, "qpos: expected .* of <U32"),
        (
            {"qpos": QPOS * [[1.0], [np.nan]]},
            "qpos: row 1: expected finite numbers and a unit quat",
        ),
        ({"qpos": QPOS * [[1.0], [1e38]]}, "qpos: row 1: expected finite numbers"),
        ({"qpos": 0 * QPOS}, "qpos: row 0: expected finite numbers and a unit quaternion"),
        *[
            ({"fps": fps}, "fps: expected a rate above 0")
            for fps in (0.0, -1.0, np.nan, np.inf, 1e300)
        ],
        *[({"fps": fps}, "fps: expected a rate above 0") for fps in ("30", [30.0], True)],
        ({"joints": "knee"}, "made for another character: lacks joint"),
        ({"joints": []}, "made for another character: lacks joint"),
        *[
            ({"report": text}, "report: expected that of an import")
            for text in ("", "[]", "5", "{}")
        ],
        ({"report": "[" * 100_000}, "report: expected that of an import"),
        ({"report": json.dumps({**vars(REPORT), "more": 1})}, "report: expected that of an import"),
        ({"report": json.dumps({**vars(REPORT), "warnings": 1})}, "report: expected that"),
    ],
)
def test_what_is_no_motion_of_the_character_is_refused(tmp_path, changes, text):
    file = tmp_path / "a.npz"
    np.savez(file, **arrays(**changes))
    with pytest.raises(MotionError, match=text):
        read_npz(file, CHARACTER)


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04", b"x" * 999, bytes(999)])
def test_what_is_no_archive_is_refused(tmp_path, content):
    (tmp_path / "a.npz").write_bytes(content)
    with pytest.raises(MotionError, match="not a clip"):
        read_arrays(tmp_path / "a.npz", ("qpos",))


def test_a_missing_array_is_named_and_others_are_not_read(tmp_path):
    file = tmp_path / "a.npz"
    np.savez(file, a=1.0, b=np.array([object()], dtype=object))
    assert read_arrays(file, ("a",)) == {"a": 1.0}
    with pytest.raises(MotionError, match=r"expected \['c'\], or .* SMPL, got \['a', 'b'\]"):
        read_arrays(file, ("c",))
    with pytest.raises(MotionError, match="not a clip"):
        read_arrays(file, ("b",))


@pytest.mark.parametrize("read", [names_in, lambda file: read_arrays(file, ("a",))])
def test_a_file_that_is_not_there_is_said(tmp_path, read):
    with pytest.raises(MotionError, match=r"gone\.npz: no such file$"):
        read(tmp_path / "gone.npz")
