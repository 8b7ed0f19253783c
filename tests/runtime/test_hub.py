"""Policies to and from the Hub, with the real library against a folder in place of the server."""

from __future__ import annotations

import shutil
import sys
import types
from pathlib import Path

import numpy as np
import pytest

from getup_jax.cli.main import export_main
from getup_jax.config import ConfigError
from getup_jax.runtime import checkpoint, hub
from getup_jax.runtime.pytree_store import CheckpointError

library = pytest.importorskip("huggingface_hub")
errors = pytest.importorskip("huggingface_hub.errors")
constants = pytest.importorskip("huggingface_hub.constants")
COMMIT = "0" * 40


@pytest.fixture
def server(tmp_path, monkeypatch) -> Path:
    """The Hub's cache as it is after a download; uploads go there, and nothing else is reached."""
    monkeypatch.setattr(constants, "HF_HUB_OFFLINE", True)
    monkeypatch.setattr(constants, "HF_HUB_CACHE", str(tmp_path / "hub"))

    def upload_folder(self, *, repo_id, folder_path, revision=None):
        repo = tmp_path / "hub" / f"models--{repo_id.replace('/', '--')}"
        shutil.copytree(folder_path, repo / "snapshots" / COMMIT)
        (repo / "refs").mkdir()
        (repo / "refs" / (revision or "main")).write_text(COMMIT)

    monkeypatch.setattr(library.HfApi, "upload_folder", upload_folder)
    monkeypatch.setattr(library.HfApi, "create_repo", lambda self, repo, **_: f"page of {repo}")
    return tmp_path / "hub"


def test_a_policy_goes_there_and_back(server, capsys):
    assert export_main(["walk", "hf://someone/my.walk"]) == 0
    assert "page of someone/my.walk" in capsys.readouterr().out
    there, here = checkpoint.load_policy("hf://someone/my.walk"), checkpoint.load_policy("walk")
    assert there.metadata["steps"] == here.metadata["steps"]
    np.testing.assert_array_equal(
        there.policy["statistics"]["mean"], here.policy["statistics"]["mean"]
    )
    card = server / "models--someone--my.walk/snapshots" / COMMIT / "README.md"
    assert "my.walk" in card.read_text(encoding="utf-8")


@pytest.mark.parametrize("address", ["hf://walk", "hf://a/b/c", "hf://a/b@", "hf:///b"])
def test_an_address_that_is_none_is_one_line(address):
    with pytest.raises(CheckpointError, match="expected hf://OWNER/NAME"):
        checkpoint.load_policy(address)


def test_what_is_not_there_is_one_line(server):
    with pytest.raises(CheckpointError, match="hf://no/body: could not be fetched") as raised:
        checkpoint.load_policy("hf://no/body")
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("kind", "status", "text"),
    [
        ("RepositoryNotFoundError", 401, "no such repository, or a private one: check the name"),
        ("HfHubHTTPError", 403, "no such repository, or a private one: check the name"),
        ("RevisionNotFoundError", 404, "there is no such branch, tag or commit"),
        ("HfHubHTTPError", 500, "try again later"),
        ("LocalEntryNotFoundError", None, "check the network"),
    ],
)
def test_a_failed_download_says_what_to_do(server, monkeypatch, kind, status, text):
    class Error(getattr(errors, kind)):
        """As the library raises it, without a server."""

        def __init__(self) -> None:
            self.response = None if status is None else types.SimpleNamespace(status_code=status)

        def __str__(self) -> str:
            return f"{status} Client Error. \n\nmore lines"

    def refuse(*_, **__):
        raise Error

    monkeypatch.setattr(library, "snapshot_download", refuse)
    with pytest.raises(CheckpointError, match=rf"hf://no/body: .* Client Error; {text}") as raised:
        checkpoint.load_policy("hf://no/body")
    assert "\n" not in str(raised.value)


def test_without_a_network_it_says_so(tmp_path, monkeypatch):
    monkeypatch.setattr(constants, "HF_HUB_CACHE", str(tmp_path))
    monkeypatch.setattr(constants, "ENDPOINT", "http://127.0.0.1:9")  # where nobody answers
    with pytest.raises(CheckpointError, match=r"could not be fetched: .*; check the network"):
        checkpoint.load_policy("hf://no/body")


def test_a_repository_without_a_policy_is_a_line(server):
    folder, commit = server / "models--some--body", "a" * 40
    (folder / "snapshots" / commit).mkdir(parents=True)
    (folder / "snapshots" / commit / "README.md").write_text("nothing else")
    (folder / "refs").mkdir()
    (folder / "refs/main").write_text(commit)
    with pytest.raises(CheckpointError, match="hf://some/body: holds no checkpoint; expected"):
        checkpoint.load_policy("hf://some/body")


def test_a_failed_upload_is_one_line(server, monkeypatch, tmp_path):
    def refuse(self, repo, **_):
        raise OSError("401 Client Error\nmore lines")

    monkeypatch.setattr(library.HfApi, "create_repo", refuse)
    with pytest.raises(CheckpointError, match="401 Client Error; log in") as raised:
        hub.upload(tmp_path, "hf://a/b")
    assert "\n" not in str(raised.value)


def test_a_missing_library_is_one_line(monkeypatch):
    monkeypatch.setitem(sys.modules, "huggingface_hub", None)
    with pytest.raises(ConfigError, match=r"pip install 'getup-jax\[hub\]'"):
        checkpoint.load_policy("hf://a/b")
