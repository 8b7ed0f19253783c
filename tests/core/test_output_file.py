"""An old result stays whole until the new one is there."""

from __future__ import annotations

import errno
import os
import threading
from pathlib import Path

import pytest

from getup_jax.cli import evaluate
from getup_jax.core.output_file import (
    OutputError,
    make_folder,
    replacing,
    write_bytes,
    write_text,
)


@pytest.fixture
def old(tmp_path) -> Path:
    file = tmp_path / "result.json"
    file.write_text("old")
    return file


def test_the_new_one_takes_its_place(old):
    with replacing(old) as part:
        assert part.suffix == ".json"
        part.write_text("new")
        assert old.read_text() == "old"
    assert old.read_text() == "new"
    write_text(old, "né")
    assert old.read_text(encoding="utf-8") == "né"
    write_bytes(old, b"\0")
    assert old.read_bytes() == b"\0"
    assert list(old.parent.iterdir()) == [old]


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_with_an_error_the_old_one_stays(old, error):
    with pytest.raises(error), replacing(old) as part:  # noqa: PT012
        part.write_text("half")
        raise error
    assert old.read_text() == "old"
    assert list(old.parent.iterdir()) == [old]


def test_a_full_disk_is_a_line_and_the_old_one_stays(old, monkeypatch):
    def full(self, *_, **__):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(OutputError, match=r"result\.json: cannot be written: No space left"):
        evaluate._write(old, {"success": 1.0})
    assert old.read_text() == "old"


def test_a_folder_that_is_not_there_is_a_line(tmp_path, old):
    with pytest.raises(OutputError, match=r"none/a\.json: cannot be written: No such file"):
        write_text(tmp_path / "none/a.json", "")
    with pytest.raises(OutputError, match=r"result\.json: cannot be written: File exists"):
        make_folder(old)
    assert make_folder(tmp_path / "a/b").is_dir()


def test_what_a_link_points_to_is_replaced(old, tmp_path):
    link = tmp_path / "link.json"
    link.symlink_to(old)
    write_text(link, "new")
    assert link.is_symlink()
    assert old.read_text() == "new"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no pipes with a name")
def test_a_pipe_is_written_as_it_is(tmp_path):
    pipe, read = tmp_path / "pipe", []
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: read.append(pipe.read_text()))
    reader.start()
    write_text(pipe, "new")
    reader.join(10)
    assert read == ["new"]


SOURCE = Path(__file__).resolve().parents[2] / "src/getup_jax"
DIRECT = ("savefig(path", "savefig(file", "imwrite(path", "get_writer(path", "Export(str(path")


def test_no_command_writes_over_a_result_directly():
    """Films of the editor go into a folder that is removed."""
    found = [
        str(file.relative_to(SOURCE))
        for file in sorted(SOURCE.rglob("*.py"))
        for text in DIRECT
        if text in file.read_text(encoding="utf-8")
    ]
    assert found == ["editor/films.py"]
    for file in sorted((SOURCE / "cli").rglob("*.py")):
        assert ".write_text(" not in file.read_text(encoding="utf-8"), file
