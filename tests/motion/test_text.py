from __future__ import annotations

import pytest

from getup_jax.motion.clips import MotionError
from getup_jax.motion.io import text
from getup_jax.motion.io.text import (
    decode,
    number,
    read_bytes,
    read_json,
    read_lines,
    read_text,
    said,
)

GERMAN, FRENCH, JAPANESE = "Größe Fuß", "Tête œil", "左足ボーン 首 頭"


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (GERMAN.encode(), GERMAN),
        (GERMAN.encode("utf-8-sig"), GERMAN),
        (GERMAN.encode("utf-16"), GERMAN),
        (GERMAN.encode("utf-16-le"), GERMAN),
        (GERMAN.encode("utf-16-be"), GERMAN),
        (GERMAN.encode("utf-32"), GERMAN),
        (GERMAN.encode("latin-1"), GERMAN),
        (FRENCH.encode("cp1252"), FRENCH),
        (JAPANESE.encode("cp932"), JAPANESE),
        ("左脚 头".encode("gbk"), "左脚 头"),
        (b"a\x81\xffb", "a\x81\xffb"),  # no code page has it: any letters, one a byte
        (b"a\r\nb\rc\n", "a\nb\nc"),
        (b"a\n\0\0\0", "a"),
        (b"a\n\x1a", "a"),
        (b"a\n\x1aold", "a"),
        (b"a\x85b\x0cc", "a…b\x0cc"),  # no line ends, whatever Python calls them
        (b"", ""),
        (b"\xff\xfe", ""),
        (b"\xff\xfea\x00\x00", "a"),
    ],
)
def test_bytes_become_the_characters_that_were_meant(content, expected):
    assert decode(content) == expected


def test_a_name_of_one_japanese_letter_beside_latin_ones_is_taken_for_an_accent():
    assert decode("Säule".encode("latin-1")) == "Säule"
    assert "親" not in decode("IK親a".encode("cp932"))


def test_a_file_that_is_no_text_or_too_large(tmp_path, monkeypatch):
    file = tmp_path / "take.bvh"
    for content, message in (
        (b"\x1f\x8b\x08zzz", "got a gzip archive; unpack it"),
        (b"Kaydara FBX Binary  \0", "got an FBX file; export it as BVH"),
        (b"HIERARCHY\n\x01\x02", "expected a text file, got binary data"),
    ):
        file.write_bytes(content)
        with pytest.raises(MotionError, match=rf"^take\.bvh: .*{message}"):
            read_text(file)
    monkeypatch.setattr(text, "MOST_BYTES", 5_000_000)
    with file.open("wb") as stream:
        stream.truncate(10**13)  # takes no room on the disk
    with pytest.raises(MotionError, match="expected at most 5 MB, got 10000000 MB; cut"):
        read_bytes(file)
    with pytest.raises(MotionError, match="cannot be read: Is a directory"):
        read_bytes(tmp_path)


def test_too_many_lines(tmp_path, monkeypatch):
    monkeypatch.setattr(text, "MOST_LINES", 10)
    file = tmp_path / "take.bvh"
    file.write_text("1\n" * 9)
    assert len(read_lines(file)) == 9
    file.write_text("1\n" * 12)
    with pytest.raises(MotionError, match="expected at most 10 lines"):
        read_lines(file)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("[" * 100_000, "line 1: broken JSON|lists too deep"),
        ("[" * 100_000 + "]" * 100_000, "expected a list of frames, got lists too deep"),
        ('{"Frames": [' + "9" * 6000 + "]}", "expected numbers, got one of too many digits"),
        ('{"Frames": [[1.0,\n nan]]', "line 2: broken JSON"),
    ],
)
def test_json_that_python_does_not_read_is_one_line(tmp_path, content, message):
    file = tmp_path / "a.txt"
    file.write_text(content)
    with pytest.raises(MotionError, match=message) as caught:
        read_json(file)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 200


def test_numbers_are_finite_and_possible():
    assert [number(word) for word in ("1", "-.5", "1e3", "+2.")] == [1, -0.5, 1000, 2]
    for word in ("nan", "inf", "1e300", "1_0", "1,5", "x", ""):
        assert number(word) is None
    assert said("1,5") == "'1,5'; decimals take a point, not a comma"
    assert len(said("x" * 1000)) < 60
