"""Policies on the Hugging Face Hub: `hf://OWNER/NAME`, or `hf://OWNER/NAME@REVISION`."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from getup_jax.runtime import integrity
from getup_jax.runtime.extras import load_extra
from getup_jax.runtime.pytree_store import CheckpointError

PREFIX = "hf://"
_ADDRESS = re.compile(r"hf://(?P<repo>[\w.-]+/[\w.-]+)(@(?P<revision>[\w./-]+))?")
_FILES = [integrity.FILE, integrity.CONFIG, "README.md", "policy/*"]  # what an export consists of


def is_address(source: str | Path) -> bool:
    """Whether a policy's name is an address of the Hub."""
    return isinstance(source, str) and source.startswith(PREFIX)


def download(address: str) -> Path:
    """The folder with the policy, in the Hub's own cache; a second time it is fetched from there.

    Raises CheckpointError where there is none, ConfigError where the extra `hub` is missing.
    """
    repo, revision = _parts(address)
    hub = _hub(address)
    try:
        folder = hub.snapshot_download(repo, revision=revision, allow_patterns=_FILES)
    except Exception as error:  # of the network, the server, the account or the disk
        text = f"{_first_line(error).rstrip('. ')}; {_what_to_do(error)}"
        raise CheckpointError(f"{address}: could not be fetched: {text}") from None
    return Path(folder)


def upload(folder: Path, address: str) -> str:
    """Put an exported policy's folder on the Hub, private where it is new; gives its page.

    Raises CheckpointError where that fails, ConfigError where the extra `hub` is missing.
    """
    repo, revision = _parts(address)
    api = _hub(address).HfApi()
    try:
        page = api.create_repo(repo, private=True, exist_ok=True)
        api.upload_folder(repo_id=repo, folder_path=folder, revision=revision)
    except Exception as error:
        hint = "log in with `hf auth login` where that is missing"
        text = _first_line(error)
        raise CheckpointError(f"{address}: could not be uploaded: {text}; {hint}") from None
    return str(page)


def _parts(address: str) -> tuple[str, str | None]:
    found = _ADDRESS.fullmatch(address)
    if found is None:
        raise CheckpointError(
            f"{address}: expected hf://OWNER/NAME, or hf://OWNER/NAME@REVISION with a branch, a "
            "tag or a commit"
        )
    return found["repo"], found["revision"]


def _hub(address: str) -> Any:
    return load_extra("huggingface_hub", "hub", address)


def _what_to_do(error: Exception) -> str:
    """The library's first line often has a status alone, and the Hub hides what is private."""
    from huggingface_hub import errors  # pyright: ignore[reportMissingImports]

    status = getattr(getattr(error, "response", None), "status_code", None)
    if isinstance(error, errors.RevisionNotFoundError):
        return "there is no such branch, tag or commit"
    if isinstance(error, errors.RepositoryNotFoundError) or status in (401, 403, 404):
        return (
            "no such repository, or a private one: check the name, or log in with `hf auth login`"
        )
    if status is None:  # no answer at all
        return "check the network; what was fetched before stays in the Hub's cache"
    return "try again later"


def _first_line(error: Exception) -> str:
    lines = str(error).strip().splitlines()
    return lines[0] if lines else type(error).__name__
