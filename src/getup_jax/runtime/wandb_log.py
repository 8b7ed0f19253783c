"""The metrics of a run on Weights & Biases, or with WANDB_MODE=offline beside the others."""

from __future__ import annotations

import uuid
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from getup_jax.config import ConfigError
from getup_jax.runtime.extras import load_extra

ID_FILE = "wandb_id"  # in the run's folder, so that a resumed run goes on there, too


class WandbLog:
    """One run of a project; its horizontal axis is `steps`."""

    def __init__(self, folder: Path, project: str, config: Mapping[str, Any]) -> None:
        """Raises ConfigError where the library is missing or nobody is logged in."""
        wandb = wandb_module()
        (folder / "wandb").mkdir(parents=True, exist_ok=True)
        try:
            self._run = wandb.init(
                project=project,
                name=folder.resolve().name,
                id=_identity(folder),
                resume="allow",
                dir=str(folder),
                config=dict(config),
                settings=wandb.Settings(console="off", silent=True),
            )
        except Exception as error:
            text = str(error).strip().splitlines() or [type(error).__name__]
            raise ConfigError(
                f"train.wandb: {text[0]}; log in with `wandb login`, or set WANDB_MODE=offline"
            ) from None
        self._run.define_metric("*", step_metric="steps")

    def write(self, steps: int, values: Mapping[str, float | None]) -> None:
        """Add what is finite."""
        known = {name: value for name, value in values.items() if value is not None}
        self._run.log({"steps": steps, **known})

    def close(self) -> None:
        """Finish the run."""
        self._run.finish()


def wandb_module() -> Any:
    """The module wandb, or ConfigError with an install hint."""
    return load_extra("wandb", "wandb", "train.wandb")


def _identity(folder: Path) -> str:
    file = folder / ID_FILE
    if not file.exists():
        file.write_text(uuid.uuid4().hex[:12] + "\n", encoding="utf-8")
    return file.read_text(encoding="utf-8").strip()
