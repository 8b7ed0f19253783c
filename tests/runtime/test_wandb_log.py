"""Weights & Biases in its offline mode, with the real library."""

from __future__ import annotations

import json
import math
import struct
import sys
import time
from pathlib import Path

import pytest

from getup_jax.config import ConfigError
from getup_jax.runtime.metric_file import MetricsWriter, read_metrics
from getup_jax.runtime.wandb_log import WandbLog


def records(file: Path) -> list:
    """What the library wrote into an offline run's file: a LevelDB log of Protobuf messages."""
    from wandb.proto import wandb_internal_pb2

    block, header, last = 32768, 7, (1, 4)
    data, found, part = file.read_bytes(), [], b""
    place = header  # of the file itself
    while place < len(data):
        left = block - place % block
        if left < header:
            place += left
            continue
        _, size, kind = struct.unpack_from("<IHB", data, place)
        place += header
        if place + size > len(data):  # not yet written
            break
        part, place = part + data[place : place + size], place + size
        if kind in last:
            found.append(wandb_internal_pb2.Record.FromString(part))
            part = b""
    return found


def test_offline_metrics_are_in_the_runs_folder(tmp_path, monkeypatch):
    pytest.importorskip("wandb")
    monkeypatch.setenv("WANDB_MODE", "offline")
    folder = tmp_path / "my_run"
    folder.mkdir()
    log = WandbLog(folder, "getup", {"seed": 3, "ppo": {"num_envs": 8}})
    with MetricsWriter(folder, wandb=log) as writer:
        writer.write(1, 16, 0.5, {"reward": 0.25, "success": math.nan})
        writer.write(2, 32, 1.0, {"reward": 0.75, "success": 1.0})
    (file,) = folder.glob("wandb/offline-run-*/*.wandb")
    written, deadline = records(file), time.monotonic() + 60
    while not any(record.HasField("exit") for record in written):  # its own process writes it
        assert time.monotonic() < deadline
        time.sleep(0.1)
        written = records(file)
    kept = []
    for record in written:
        if record.HasField("history"):
            items = record.history.item
            row = {x.key or x.nested_key[0]: json.loads(x.value_json) for x in items}
            kept.append({n: row[n] for n in ("steps", "reward", "success") if n in row})
    assert kept == [
        {"steps": 16, "reward": 0.25},
        {"steps": 32, "reward": 0.75, "success": 1.0},
    ]
    (run,) = (record.run for record in written if record.HasField("run"))
    assert (run.project, run.display_name) == ("getup", "my_run")
    assert run.run_id == (folder / "wandb_id").read_text().strip()
    assert [row["reward"] for row in read_metrics(folder)] == [0.25, 0.75]


def test_a_missing_library_is_one_line(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "wandb", None)
    with pytest.raises(ConfigError, match=r"train\.wandb: needs wandb; .*'getup-jax\[wandb\]'"):
        WandbLog(tmp_path, "getup", {})


def test_a_refusal_of_the_library_is_one_line(tmp_path, monkeypatch):
    wandb = pytest.importorskip("wandb")

    def refuse(**_):
        raise wandb.errors.UsageError("No API key configured.\nmore lines")

    monkeypatch.setattr(wandb, "init", refuse)
    with pytest.raises(ConfigError, match=r"No API key configured\.; log in") as raised:
        WandbLog(tmp_path, "getup", {})
    assert "\n" not in str(raised.value)
