from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from motion_samples import PRONE, SUPINE, getup_clip

from getup_jax.config import MotionConfig
from getup_jax.motion import library
from getup_jax.motion.clips import MotionError
from getup_jax.motion.io.bvh_writer import write_bvh
from getup_jax.motion.io.readers import ReadOptions
from getup_jax.motion.retarget.body import record
from getup_jax.motion.retarget.cache import Job, key, read_npz, retarget_files, write_npz
from getup_jax.motion.retarget.retarget import RetargetSettings


@pytest.fixture(scope="module")
def folder(tmp_path_factory, character):
    """A folder with two get-ups as BVH files, and one cache for all tests here."""
    path = tmp_path_factory.mktemp("motions")
    for name, lying in (("back", SUPINE), ("front", PRONE)):
        clip = getup_clip(character, lying, still_s=0.5, rise_s=1.1, name=name)
        write_bvh(record(clip, character), path / f"{name}.bvh")
    return path


@pytest.fixture(scope="module", autouse=True)
def shared_cache(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("GETUP_JAX_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


def load(character, *source, **settings):
    return library.load_motions(MotionConfig(source=source, **settings), character)


def test_a_folder_of_recordings(character, folder):
    seen = []
    config = MotionConfig(source=(str(folder),))
    loaded = library.load_motions(config, character, seen.append)
    assert {file.name for file in seen} == {"back.bvh", "front.bvh"}
    assert [getup.name.split(":")[0] for getup in loaded.getups] == ["back", "front"]
    frames = sum(report.frames for report in loaded.report.values())
    assert loaded.poses.shape == (2 * frames, 7 + character.num_joints)
    half = len(loaded.poses) // 2
    np.testing.assert_allclose(loaded.poses[half:], character.mirror(loaded.poses[:half]))
    assert len(load(character, str(folder), mirror=False).poses) == frames


def test_explicit_cuts(character, folder):
    loaded = load(character, str(folder / "back.bvh"), curves=("back:5-50", "back:0-60"))
    assert [getup.name for getup in loaded.getups] == ["back:5-50", "back:0-60"]
    assert loaded.getup("back:5-50").duration == pytest.approx(45 / 30)


def test_a_clips_name_takes_all_its_getups(character, folder):
    (getup,) = load(character, str(folder), curves=("front",)).getups
    assert getup.name.startswith("front:")


@pytest.mark.parametrize("name", ["nothing", "nothing:3-60"])
def test_an_unknown_curve_lists_what_there_is(character, folder, name):
    with pytest.raises(MotionError, match=rf"no get-up '{name}'; found: back:\d+-\d+, front:"):
        load(character, str(folder), curves=(name,))


def test_an_unknown_source(character, tmp_path):
    with pytest.raises(MotionError, match="expected 'authored', 'deepmimic', a folder or a file"):
        load(character, str(tmp_path / "nowhere"))
    with pytest.raises(MotionError, match="no motion files in this folder"):
        load(character, str(tmp_path))


def test_deepmimic_without_pybullet_says_what_to_install(character, monkeypatch):
    monkeypatch.setattr(library.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(MotionError, match=r"pip install 'getup-jax\[deepmimic\]'"):
        load(character, "deepmimic")


def test_two_files_of_one_name(character, folder, tmp_path):
    (tmp_path / "back.bvh").write_bytes((folder / "back.bvh").read_bytes())
    with pytest.raises(MotionError, match=r"two get-ups are called back:.*rename one"):
        load(character, str(folder), str(tmp_path))


def test_the_second_time_comes_from_the_cache(character, folder, monkeypatch):
    job = Job(folder / "back.bvh", character, ReadOptions(), RetargetSettings())
    (first,) = retarget_files([job], 1)
    monkeypatch.setattr(
        "getup_jax.motion.retarget.cache.run_here", lambda job: pytest.fail("run again")
    )
    (second,) = retarget_files([job], 1)
    np.testing.assert_allclose(second[0].qpos, first[0].qpos, atol=1e-6)
    assert second[1] == first[1]


def test_the_cache_depends_on_content_options_and_character(character, folder, tmp_path):
    job = Job(folder / "back.bvh", character, ReadOptions(), RetargetSettings())
    changed = tmp_path / "back.bvh"
    changed.write_text(job.path.read_text() + "\n")
    longer = dataclasses.replace(character, neutral_qpos=character.neutral_qpos + 0.01)
    others = [
        dataclasses.replace(job, path=changed),
        dataclasses.replace(job, settings=RetargetSettings(fps=60.0)),
        dataclasses.replace(job, character=longer),
    ]
    assert len({key(job), *map(key, others)}) == 4


def test_a_bad_file_does_not_stop_the_others(character, folder, tmp_path):
    bad = tmp_path / "bad.bvh"
    bad.write_text("HIERARCHY\nMOTION\n")
    jobs = [
        Job(file, character, ReadOptions(), RetargetSettings())
        for file in (bad, folder / "front.bvh")
    ]
    error, good = retarget_files(jobs, 2)
    assert isinstance(error, MotionError)
    assert len(good[0].qpos) == good[1].frames


def test_clips_as_files(character, folder, tmp_path):
    job = Job(folder / "back.bvh", character, ReadOptions(), RetargetSettings())
    ((clip, report),) = retarget_files([job], 1)
    file = tmp_path / "back.npz"
    write_npz(file, clip, report, character)
    again, same = read_npz(file, character)
    assert same == report
    np.testing.assert_allclose(again.qpos, clip.qpos, atol=1e-6)
    assert len(load(character, str(file)).getups) == 1
    names = character.joint_names
    for joints, message in (
        (("knee", *names[1:]), f"lacks joint knee, has joint {names[0]}, which this one has not"),
        (names[1:], f"has joint {names[0]}, which this one has not"),
        ((*names, "tail_flex"), "lacks joint tail_flex; import its source again"),
        (names[::-1], f"another order, {names[0]} where this one has {names[-1]}; import"),
    ):
        with pytest.raises(MotionError, match=f"made for another character: .*{message}"):
            read_npz(file, dataclasses.replace(character, joint_names=joints))
    file.write_bytes(b"no clip")
    with pytest.raises(MotionError, match="not a clip"):
        read_npz(file, character)


def test_lafan1_reference_cut(mocap, character, tmp_path):
    """The first frames of a take, cut by hand as the papers' reference curves are."""
    lines = (mocap / "lafan1" / "fallAndGetUp2_subject2.bvh").read_text().splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith("Frame Time")) + 1
    head = ["Frames: 540" if "Frames:" in line else line for line in lines[:first]]
    part = tmp_path / "take.bvh"
    part.write_text("\n".join(head + lines[first : first + 540]))
    (getup,) = load(character, str(part), curves=("take:254-509",)).getups
    assert getup.duration == pytest.approx(8.5)
    assert getup.points[0, 0] < 0.5 < 1.0 < getup.points[-1, 0]
