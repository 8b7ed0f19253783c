from __future__ import annotations

import json
import re

import pytest
from motion_samples import SUPINE, getup_clip

from getup_jax.cli import motion_files
from getup_jax.cli.motion import main
from getup_jax.core.output_file import OutputError
from getup_jax.motion.clips import MotionError
from getup_jax.motion.io.bvh_writer import write_bvh
from getup_jax.motion.retarget.body import record
from getup_jax.motion.retarget.job import run_here


@pytest.fixture
def rise(tmp_path, character, cache):
    """A folder with one BVH file of a get-up."""
    clip = getup_clip(character, SUPINE, still_s=0.4, rise_s=0.8)
    folder = tmp_path / "in"
    folder.mkdir()
    write_bvh(record(clip, character), folder / "rise.bvh")
    return folder


def test_import_list_events_and_plot(rise, tmp_path, capsys):
    pytest.importorskip("matplotlib")
    report = tmp_path / "report.json"
    clips = tmp_path / "clips"
    assert main(["import", str(rise), "--out", str(clips), "--json", str(report)]) == 0
    (entry,) = json.loads(report.read_text())
    assert entry["frames"] == 48
    assert entry["errors"] == []
    assert entry["position_error_m"] < 0.02
    (event,) = entry["events"]
    assert event["start"] < event["end"]
    assert event["orientation"] == "supine"
    assert main(["list", str(clips)]) == 0
    assert "rise:" in capsys.readouterr().out
    assert main(["events", str(clips / "rise.npz")]) == 0
    assert "supine" in capsys.readouterr().out
    assert main(["plot", str(clips), "--out", str(tmp_path / "curves.png")]) == 0
    assert (tmp_path / "curves.png").read_bytes().startswith(b"\x89PNG")
    classes = tmp_path / "strategies.png"
    assert main(["plot", str(clips), "--strategies", "--out", str(classes)]) == 0
    assert classes.read_bytes().startswith(b"\x89PNG")
    assert classes.read_bytes() != (tmp_path / "curves.png").read_bytes()


def test_a_bad_file_is_reported_and_the_others_go_on(rise, tmp_path, capsys):
    (rise / "bad.bvh").write_text("HIERARCHY\nROOT a\n{\n")
    report = tmp_path / "report.json"
    assert main(["import", str(rise), "--json", str(report)]) == 1
    bad, good = json.loads(report.read_text())
    assert "bad.bvh" in bad["errors"][0]
    assert bad["frames"] == 0
    assert good["frames"] == 48
    said = capsys.readouterr()
    assert "error: bad.bvh" in said.out
    line = r"^(\d)/2 (\w+)\.bvh(?: failed)?  [\d.]+ s a file, \d+ s left$"  # as each is done
    done = re.findall(line, said.err, re.MULTILINE)
    assert "bad.bvh failed" in said.err
    assert [count for count, _ in done] == ["1", "2"]
    assert {name for _, name in done} == {"bad", "rise"}


def test_what_is_done_is_kept_when_ctrl_c_comes(rise, tmp_path, monkeypatch, capsys):
    (rise / "again.bvh").write_text((rise / "rise.bvh").read_text())

    def interrupted(jobs, workers, done):
        done(jobs[0].path, run_here(jobs[0]))
        raise KeyboardInterrupt

    monkeypatch.setattr(motion_files, "retarget_files", interrupted)
    clips = tmp_path / "clips"
    with pytest.raises(KeyboardInterrupt):
        main(["import", str(rise), "--out", str(clips)])
    assert [file.name for file in clips.iterdir()] == ["again.npz"]
    assert "1 of 2 files are done; again goes on there" in capsys.readouterr().err


def test_a_folder_that_cannot_be_made_is_a_line(rise):
    with pytest.raises(OutputError, match=r"rise\.bvh: cannot be written: File exists"):
        main(["import", str(rise), "--out", str(rise / "rise.bvh")])


def test_what_is_retargeted_to_another_body_is_shown(tmp_path, monkeypatch, capsys):
    files = [tmp_path / "a.yaml", tmp_path / "b.yaml"]

    def load(config, character, done):
        for file in files:
            done(file)
        return "library"

    monkeypatch.setattr(motion_files, "load_motions", load)
    monkeypatch.setattr(motion_files, "to_retarget", lambda config, character: files)
    for long_s, shown in ((1e-9, ["1/2 a.yaml", "2/2 b.yaml"]), (60.0, [])):
        monkeypatch.setattr(motion_files, "_LONG_S", long_s)
        assert motion_files.load_library("config", "character") == "library"  # type: ignore[arg-type]
        said = capsys.readouterr().err
        assert [line.partition("  ")[0] for line in said.splitlines()] == shown


def test_a_file_that_lacks_one_row_is_used_and_reported(rise, tmp_path, capsys):
    file, report = rise / "rise.bvh", tmp_path / "report.json"
    file.write_text(file.read_text().replace("Frames: 48", "Frames: 49"))
    assert main(["import", str(file), "--json", str(report)]) == 0
    assert "warning: rise.bvh: header says 49 frames" in capsys.readouterr().out
    (entry,) = json.loads(report.read_text())
    assert entry["warnings"] == ["header says 49 frames, file has 48 rows; 48 frames are used"]
    assert entry["errors"] == []
    assert entry["frames"] == 48
    assert len(entry["events"]) == 1


def test_a_file_that_lacks_more_rows_needs_a_flag(rise, capsys):
    file = rise / "rise.bvh"
    file.write_text(file.read_text().replace("Frames: 48", "Frames: 50"))
    assert main(["import", str(file)]) == 1
    assert "header says 50 frames, file has 48 rows" in capsys.readouterr().out
    assert main(["import", str(file), "--allow-short"]) == 0
    assert "warning" in capsys.readouterr().out


@pytest.mark.parametrize("command", ["import", "events", "list", "plot"])
def test_every_command_explains_itself(command, capsys):
    with pytest.raises(SystemExit) as stop:
        main([command, "--help"])
    assert stop.value.code == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "exit code: 0" in text
    assert "authored, deepmimic, a folder or a file" in text or command in ("import", "events")


def test_a_clip_that_never_lies_is_warned_about(tmp_path, character, cache, capsys):
    clip = getup_clip(character, SUPINE)
    clip.qpos[:] = character.neutral_qpos
    write_bvh(record(clip, character), tmp_path / "stand.bvh")
    assert main(["import", str(tmp_path / "stand.bvh")]) == 0
    assert "no get-up found: it never lies" in capsys.readouterr().out


@pytest.mark.parametrize(
    "words",
    [
        ["import", "--json", "none/report.json"],
        ["import", "--json", "report.txt"],
        ["plot", "--out", "none/curves.png"],
    ],
)
def test_a_file_that_cannot_be_written_is_refused_before_the_work(rise, words, capsys):
    with pytest.raises(SystemExit):
        main([words[0], str(rise), *words[1:]])
    said = capsys.readouterr().err
    assert "no folder none" in said or "that ends in .json" in said


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("--fps", "0"),
        ("--fps", "nan"),
        ("--source-fps", "1e9"),
        ("--scale", "0"),
        ("--floor", "inf"),
    ],
)
def test_numbers_that_cannot_be_are_refused(rise, option, value, capsys):
    with pytest.raises(SystemExit) as stop:
        main(["import", str(rise), option, value])
    assert stop.value.code == 2
    assert f"argument {option}: expected " in capsys.readouterr().err


def test_an_empty_folder_and_a_missing_map(tmp_path, rise):
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(MotionError, match="no motion files"):
        main(["import", str(empty)])
    with pytest.raises(MotionError, match="not a readable name map"):
        main(["import", str(rise), "--names", str(tmp_path / "map.yaml")])
