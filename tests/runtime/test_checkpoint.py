from __future__ import annotations

import dataclasses
import errno
import json
import random
import resource
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from checkpoint_samples import assert_same, make_policy, make_state
from getup_jax.config import Config, load
from getup_jax.core.resources import asset_path
from getup_jax.runtime import checkpoint, integrity, pytree_store
from getup_jax.runtime.checkpoint import export_policy, load_policy, restore_learner, save_learner
from getup_jax.runtime.pytree_store import CheckpointError, from_nested


def save(folder: Path, iteration: int, keep: int = 2, width: int = 8, also=()) -> Path:
    config = load.load_config(None, [f"train.keep={keep}", "seed=5", *also])
    prior, critic = {"decoder": jnp.ones((2, 2))}, {"critic": jnp.full(3, 7.0)}
    item = {"policy": make_policy(iteration, width), "prior": prior, "critic": critic}
    state = make_state(iteration, width)
    return save_learner(folder, iteration, state, config, item, {"steps": iteration * 10})


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.fixture(scope="module")
def saved(tmp_path_factory) -> Path:
    """A run folder with the checkpoints 3 and 4; tests copy it before they change it."""
    run = tmp_path_factory.mktemp("run")
    save(run / "checkpoints", 3)
    save(run / "checkpoints", 4)
    return run


@pytest.fixture
def run(saved, tmp_path) -> Path:
    return Path(shutil.copytree(saved, tmp_path / "run"))


def assert_nested_same(found: Any, expected: Any) -> None:
    """Nested dicts and tuples with the same arrays, bit by bit."""
    if isinstance(expected, dict | tuple):
        assert type(found) is type(expected)
        assert len(found) == len(expected)
        for key in expected if isinstance(expected, dict) else range(len(expected)):
            assert_nested_same(found[key], expected[key])
    elif isinstance(expected, np.ndarray):
        assert (found.dtype, found.tobytes()) == (expected.dtype, expected.tobytes())
    else:
        assert found == expected


def test_restore_is_bit_equal(saved):
    restored = restore_learner(saved / "checkpoints", make_state(0))
    assert_same(restored.state, make_state(4))
    assert restored.metadata == {"iteration": 4, "steps": 40}
    assert restored.path == saved / "checkpoints" / "00000004"


@pytest.mark.parametrize("path", ["", "checkpoints", "checkpoints/00000004"])
def test_load_policy_takes_every_kind_of_folder(saved, path):
    loaded = load_policy(saved / path)
    assert_same(from_nested(make_policy(0), loaded.policy, "policy"), make_policy(4))
    assert loaded.prior["decoder"].tolist() == [[1, 1], [1, 1]]
    assert loaded.config.seed == 5
    assert loaded.metadata["steps"] == 40


def test_load_policy_needs_no_learner(run):
    shutil.rmtree(run / "checkpoints" / "00000004" / "learner")
    assert load_policy(run).metadata["iteration"] == 4


def test_relative_paths_work(run, monkeypatch):
    monkeypatch.chdir(run.parent)
    save(Path("run/checkpoints"), 5)
    assert load_policy("run").metadata["iteration"] == 5


def test_a_shipped_policy_is_found_by_name_but_a_mistyped_path_is_not(tmp_path, monkeypatch, saved):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(
        checkpoint, "asset_path", lambda *parts: tmp_path.joinpath("assets", *parts)
    )
    export_policy(saved, tmp_path / "assets" / "checkpoints" / "toy")
    assert load_policy("toy").metadata == load_policy("assets/checkpoints/toy").metadata
    with pytest.raises(CheckpointError, match="runs/toy: no such folder"):
        load_policy("runs/toy")


def test_only_the_newest_are_kept(tmp_path):
    for iteration in (1, 2, 10, 11):
        save(tmp_path, iteration, keep=2)
    assert names(tmp_path) == ["00000010", "00000011"]
    save(tmp_path, 12, keep=1)
    assert names(tmp_path) == ["00000012"]


def test_the_same_iteration_can_be_saved_again(run):
    save(run / "checkpoints", 4, width=9)
    assert_same(restore_learner(run / "checkpoints", make_state(0, 9)).state, make_state(4, 9))
    assert names(run / "checkpoints") == ["00000003", "00000004"]


# --- damage


def largest(folder: Path) -> Path:
    return max((p for p in folder.rglob("*") if p.is_file()), key=lambda p: p.stat().st_size)


def truncate(step: Path) -> Path:
    file = largest(step / "learner")
    file.write_bytes(file.read_bytes()[:-20])
    return file


def flip_a_bit(step: Path) -> Path:
    file = largest(step / "learner")
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)
    return file


def remove_a_file(step: Path) -> Path:
    file = largest(step / "learner")
    file.unlink()
    return file


def remove_the_manifest(step: Path) -> Path:
    (step / integrity.FILE).unlink()
    return step / integrity.FILE


def break_the_manifest(step: Path) -> Path:
    (step / integrity.FILE).write_text('{"format":')
    return step / integrity.FILE


DAMAGES = [truncate, flip_a_bit, remove_a_file, remove_the_manifest, break_the_manifest]


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_newest_checkpoint_falls_back_to_the_one_before(run, damage):
    file = damage(run / "checkpoints" / "00000004")
    with pytest.warns(RuntimeWarning, match="going back to .*00000003") as warned:
        restored = restore_learner(run / "checkpoints", make_state(0))
    assert str(file) in str(warned[0].message)
    assert_same(restored.state, make_state(3))
    # Going on from 3, the damaged one does not count as one of the two that are kept.
    save(run / "checkpoints", 5)
    assert names(run / "checkpoints") == ["00000003", "00000005"]


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_checkpoint_asked_for_by_name_is_an_error(run, damage):
    step = run / "checkpoints" / "00000004"
    file = damage(step)
    with pytest.raises(CheckpointError) as caught:
        restore_learner(step, make_state(0))
    assert str(file) in str(caught.value)


def test_all_damaged_is_an_error(run):
    for name in ("00000003", "00000004"):
        truncate(run / "checkpoints" / name)
    with (
        pytest.warns(RuntimeWarning, match="going back"),
        pytest.raises(CheckpointError, match=r"00000003.*expected \d+ bytes, got"),
    ):
        restore_learner(run / "checkpoints", make_state(0))


def test_what_orbax_cannot_read_is_damaged_too(run, monkeypatch):
    def fail(folder: Path):
        raise RuntimeError("bad block")

    monkeypatch.setattr(checkpoint, "read_item", fail)
    with pytest.raises(CheckpointError, match=r"00000004/policy: cannot be read: bad block"):
        load_policy(run / "checkpoints" / "00000004")


def only_policy(step: Path) -> tuple:
    loaded = load_policy(step)
    return loaded.policy, loaded.prior, loaded.config, loaded.metadata


def only_learner(step: Path) -> tuple:
    restored = restore_learner(step, make_state(0))
    return pytree_store.to_nested({"state": restored.state}), restored.metadata


def unsealed(step: Path) -> None:
    """The manifest as it was before it covered config.yaml and itself."""
    file = step / integrity.FILE
    content = json.loads(file.read_text())
    assert content.pop("content_sha256")
    assert content["files"].pop("config.yaml")
    file.write_text(json.dumps(content, indent=1) + "\n")


def outcome(read, step: Path):
    """What a checkpoint gives, or the text of its refusal."""
    try:
        return read(step)
    except CheckpointError as error:
        return str(error)


def assert_one_line(text: str, file: Path) -> None:
    """Which file, what is wrong, what to do."""
    assert text.startswith(f"{file}: ")
    assert text.endswith("; the checkpoint is damaged; use another one, or a copy of this one")
    assert "\n" not in text


def flips(file: Path, count: int) -> Iterator[None]:
    """The file with one byte changed, so often; afterwards as it was."""
    draw, content = random.Random(file.name), file.read_bytes()
    for _ in range(count):
        changed = bytearray(content)
        changed[draw.randrange(len(content))] ^= draw.randrange(1, 256)
        file.write_bytes(changed)
        yield
    file.write_bytes(content)


def small_files(step: Path) -> list[Path]:
    return sorted(p for p in step.rglob("*") if p.is_file() and 0 < p.stat().st_size < 20_000)


def test_a_changed_byte_is_refused_in_one_line_or_has_no_effect(run):
    step = run / "checkpoints" / "00000004"
    whole = {read: outcome(read, step) for read in (only_policy, only_learner)}
    readers = {"policy": [only_policy], "learner": [only_learner], "config.yaml": [only_policy]}
    files, refused = small_files(step), 0
    assert {file.relative_to(step).parts[0] for file in files} == {*readers, integrity.FILE}
    for file in files:
        for _ in flips(file, 150 if file.parent == step else 20):
            for read in readers.get(file.relative_to(step).parts[0], whole):
                found = outcome(read, step)
                if isinstance(found, str):
                    refused += 1
                    assert_one_line(found, file)
                else:
                    assert_nested_same(found, whole[read])
    assert refused > 400


def test_an_older_manifest_is_never_a_traceback(run, monkeypatch):
    step = run / "checkpoints" / "00000004"
    unsealed(step)
    monkeypatch.setattr(checkpoint, "read_item", lambda folder: {"policy": {}})
    for file in (step / integrity.FILE, step / integrity.CONFIG):
        for _ in flips(file, 100):
            found = outcome(only_policy, step)
            if isinstance(found, str):
                assert str(step) in found
                assert "\n" not in found


def test_checkpoints_from_before_config_was_covered_load(run):
    for name in ("00000003", "00000004"):
        unsealed(run / "checkpoints" / name)
    assert load_policy(run).config.seed == 5
    restored = restore_learner(run / "checkpoints", make_state(0))
    assert_same(restored.state, make_state(4))


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"seed: 6\n", "expected .* bytes, got 8"),
        (None, "is missing"),
    ],
)
def test_a_changed_config_falls_back_to_the_checkpoint_before(run, content, problem):
    file = run / "checkpoints" / "00000004" / "config.yaml"
    file.unlink() if content is None else file.write_bytes(content)
    with pytest.warns(RuntimeWarning, match=rf"config\.yaml: {problem}.*going back to .*00000003"):
        assert load_policy(run).metadata["iteration"] == 3
    # the training does not read it
    assert restore_learner(run / "checkpoints", make_state(0)).metadata["iteration"] == 4


def test_nul_bytes_in_an_older_config_say_what_to_do(run):
    step = run / "checkpoints" / "00000004"
    unsealed(step)
    file = step / "config.yaml"
    file.write_bytes(b"\0" * 500)
    with pytest.raises(CheckpointError) as caught:
        load_policy(step)
    assert_one_line(str(caught.value), file)
    assert ": broken YAML: not text: special characters are not allowed" in str(caught.value)


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"metadata": {"iteratino": 4}}, "metadata: has no iteration"),
        ({"files": {"policy/x": {"bytes": 1}}}, "policy/x.*expected bytes and sha256"),
        ({"files": {"policy/../../x": {"bytes": 1, "sha256": ""}}}, "outside of the checkpoint"),
        ({"files": []}, r"files: expected dict, got \[\]"),
        ({"filse": {}}, "has the unknown key 'filse'"),
        ({"package": None}, "package: expected str, got None"),
    ],
)
def test_a_manifest_of_another_form_is_damaged(run, change, problem):
    file = run / "checkpoints" / "00000004" / integrity.FILE
    file.write_text(json.dumps(integrity.sealed(json.loads(file.read_text()) | change)))
    with pytest.raises(integrity.DamagedError, match=problem):
        load_policy(file.parent)


# --- other formats, shapes and places


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format": "else"}, "expected format 'getup_jax checkpoint'"),
        ({"version": 9, "package": "7.1"}, "expected version 1, got 9; use getup_jax 7.1"),
    ],
)
def test_another_format_is_an_error_and_no_damage(run, change, message):
    file = run / "checkpoints" / "00000004" / integrity.FILE
    file.write_text(json.dumps(integrity.sealed(json.loads(file.read_text()) | change)))
    with pytest.raises(CheckpointError, match=message) as caught:
        load_policy(run)
    assert str(file) in str(caught.value)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda tmp: tmp / "none", "none: no such folder"),
        (lambda tmp: tmp, "holds no checkpoint; expected a run folder"),
    ],
)
def test_a_missing_checkpoint_is_an_error(tmp_path, make, message):
    with pytest.raises(CheckpointError, match=message):
        load_policy(make(tmp_path))


def test_a_config_of_another_version_is_an_error(run):
    file = run / "checkpoints" / "00000004" / "config.yaml"
    file.write_text(file.read_text() + "new_part: {x: 1}\n")
    integrity.write(file.parent, {"iteration": 4})
    with pytest.raises(CheckpointError, match=r"new_part: unknown key.*version of getup_jax"):
        load_policy(run)


# --- interrupted saves


def test_a_partial_folder_is_ignored_and_cleaned_up(run):
    folder = run / "checkpoints"
    partial = folder / f"{integrity.PARTIAL}00000005"
    shutil.copytree(folder / "00000004" / "policy", partial / "policy")
    assert restore_learner(folder, make_state(0)).metadata["iteration"] == 4
    save(folder, 6)
    assert names(folder) == ["00000004", "00000006"]


@pytest.mark.parametrize("where", ["write_item", "integrity.write", "integrity.replace_folder"])
def test_a_full_disk_costs_nothing_but_the_new_checkpoint(run, monkeypatch, where):
    def fail(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(f"getup_jax.runtime.checkpoint.{where}", fail)
        with pytest.raises(CheckpointError, match=r"00000005: could not be saved.*No space left"):
            save(run / "checkpoints", 5)
    assert names(run / "checkpoints") == ["00000003", "00000004"]
    assert_same(restore_learner(run / "checkpoints", make_state(0)).state, make_state(4))
    save(run / "checkpoints", 6)
    assert restore_learner(run / "checkpoints", make_state(0)).metadata["iteration"] == 6


# Orbax's own threads may outlive the failed save for a moment.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_write_that_the_system_refuses_is_an_error(run):
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, limits[1]))
    try:
        with pytest.raises(CheckpointError, match=r"could not be saved.*free disk space"):
            save(run / "checkpoints", 5, width=4000)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert restore_learner(run / "checkpoints", make_state(0)).metadata["iteration"] == 4


KILLED = """
import os, pathlib, signal, sys
from getup_jax import config
from getup_jax.runtime import checkpoint
write = checkpoint.write_item
def killed(folder, nested):
    write(folder, nested)
    if folder.name == "learner":
        os.kill(os.getpid(), signal.SIGKILL)
checkpoint.write_item = killed
state = {"x": checkpoint.to_nested({"y": 1.0})["y"]}
checkpoint.save_learner(pathlib.Path(sys.argv[1]), 5, state, config.Config(), {"policy": state})
"""


def test_kill_9_while_saving_costs_nothing_but_the_new_checkpoint(run):
    folder = run / "checkpoints"
    process = subprocess.run([sys.executable, "-c", KILLED, str(folder)], timeout=60, check=False)
    assert process.returncode == -9
    assert f"{integrity.PARTIAL}00000005" in names(folder)
    assert_same(restore_learner(folder, make_state(0)).state, make_state(4))


# --- export


def test_export_copies_only_the_policy(saved, tmp_path):
    exported = export_policy(saved, tmp_path / "out" / "flat")
    assert names(exported) == ["checkpoint.json", "config.yaml", "policy"]
    loaded, original = load_policy(exported), load_policy(saved)
    assert_same(loaded.policy, original.policy)
    assert_same(loaded.prior, original.prior)
    assert_same(loaded.critic, original.critic)
    assert loaded.critic["critic"].tolist() == [7.0] * 3
    assert dataclasses.replace(loaded.config) == original.config
    assert loaded.config.train.init_from is None
    with pytest.raises(CheckpointError, match="has no item 'learner'"):
        restore_learner(exported, make_state(0))


def test_an_exported_policy_names_no_folder_of_this_machine(tmp_path):
    states, other = tmp_path / "states", tmp_path / "other"
    saved = tmp_path / "run"
    also = [f"curriculum.archive={states}", f"train.init_from={other}"]
    save(saved / "checkpoints", 3, also=also)
    exported = export_policy(saved, tmp_path / "flat")
    content = b"".join(p.read_bytes() for p in exported.rglob("*") if p.is_file())
    assert str(saved).encode() not in content
    assert str(tmp_path).encode() not in content


def test_an_exported_policy_runs_on_other_machines_than_the_training_s(saved, tmp_path):
    path = saved / "checkpoints" / "00000004"
    loaded = load_policy(path)
    physics = dataclasses.replace(loaded.config.physics, engine="mjx-warp")
    config = dataclasses.replace(loaded.config, physics=physics)
    item = {"policy": loaded.policy, "prior": loaded.prior}
    save_learner(tmp_path / "run", 1, make_state(0), config, item)
    exported = export_policy(tmp_path / "run", tmp_path / "flat")
    assert load_policy(exported).config.physics.engine == "auto"


def test_an_export_can_be_replaced_but_replaces_nothing_else(saved, tmp_path):
    export_policy(saved / "checkpoints" / "00000003", tmp_path / "flat")
    export_policy(saved, tmp_path / "flat")
    assert load_policy(tmp_path / "flat").metadata["iteration"] == 4
    (tmp_path / "mine").mkdir()
    with pytest.raises(CheckpointError, match="mine: exists and is no checkpoint"):
        export_policy(saved, tmp_path / "mine")


def test_an_export_is_at_most_5_mb(run, tmp_path, monkeypatch):
    monkeypatch.setattr(checkpoint, "MAX_EXPORT_BYTES", 1000)
    with pytest.raises(CheckpointError, match=r"bytes, at most 1000 are allowed"):
        export_policy(run, tmp_path / "flat")
    assert names(tmp_path) == ["run"]


def test_shipped_policies_load():
    for file in asset_path("checkpoints").glob("*/checkpoint.json"):
        content = json.loads(file.read_text())
        assert content == integrity.sealed(content), "the manifest does not cover itself"
        assert integrity.CONFIG in content["files"]
        loaded = load_policy(file.parent)
        assert isinstance(loaded.config, Config)
        assert pytree_store.is_finite({"policy": loaded.policy})
