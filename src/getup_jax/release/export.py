"""Make a folder to ship out of a run: the policy item alone, and a model card.

    getup-export runs/flat assets/checkpoints/flat --eval eval.json
    getup-export runs/flat --onnx flat.onnx

The folder holds the weights, the pose prior, the resolved config and the format version, is at
most `checkpoint.MAX_EXPORT_BYTES` large, and is read by `getup-eval --ckpt FOLDER`.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from getup_jax.config import ConfigError
from getup_jax.evaluation.options import output
from getup_jax.release.card import Provenance, model_card
from getup_jax.runtime import checkpoint, hub
from getup_jax.runtime.checkpoint import LoadedPolicy
from getup_jax.runtime.metric_file import FILE, read_metrics

CARD = "README.md"


def main(argv: Sequence[str] | None = None) -> int:
    """`getup-export`; returns the exit code. Errors are for the caller to print."""
    args = _parser().parse_args(argv)
    if args.out is None and args.onnx is None:
        raise ConfigError("getup-export: expected a folder OUT, --onnx FILE, or both; got neither")
    if args.onnx is not None:
        from getup_jax.release.onnx_export import export_onnx

        for file in export_onnx(args.run, args.onnx):
            print(f"{file}: {file.stat().st_size / 1e6:.2f} MB")
    if args.out is None:
        return 0
    more = (args.eval, args.machine, args.commit, args.before)
    if hub.is_address(args.out):
        with tempfile.TemporaryDirectory() as folder:
            name = args.out.rpartition("/")[2]
            print(
                f"{args.out}: {hub.upload(export(args.run, Path(folder) / name, *more), args.out)}"
            )
        return 0
    folder = export(args.run, Path(args.out), *more)
    size = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
    print(f"{folder}: {size / 1e6:.2f} MB; look at {folder / CARD}")
    return 0


def export(
    run: str | Path,
    out: Path,
    evaluations: Sequence[Path] = (),
    machine: str | None = None,
    commit: str | None = None,
    before: str | None = None,
) -> Path:
    """Write the newest policy of a run (or one checkpoint) and its card to the folder `out`.

    Raises CheckpointError, or ConfigError where an evaluation is of another policy.
    """
    loaded = checkpoint.load_policy(run)
    results = [_evaluation(file, loaded) for file in evaluations]
    provenance = Provenance(commit or _commit(), _wall_s(loaded), machine, before)
    text = model_card(out.name, loaded, provenance, results)
    checkpoint.export_policy(loaded.path, out)
    (out / CARD).write_text(text, encoding="utf-8")
    return out


def _evaluation(file: Path, loaded: LoadedPolicy) -> Mapping[str, Any]:
    """What `getup-eval --json` wrote, of the same policy."""
    try:
        result = json.loads(file.read_text(encoding="utf-8"))
        found = [result["policy"].get(key) for key in ("iteration", "steps", "seed")]
    except (OSError, ValueError, KeyError, TypeError) as error:
        problem = f"{type(error).__name__}: {error}"
        raise ConfigError(
            f"--eval: {file}: expected a file of getup-eval --json ({problem})"
        ) from None
    expected = [loaded.metadata.get(key) for key in ("iteration", "steps")] + [loaded.config.seed]
    if found != expected:
        raise ConfigError(
            f"--eval: {file}: is of iteration, steps and seed {found}, but {loaded.path} is of "
            f"{expected}; evaluate what is exported"
        )
    if ("imitation_error_m" in result) != loaded.config.composite_motion:
        raise ConfigError(
            f"--eval: {file}: is of another task than {loaded.path}; evaluate what is exported"
        )
    return result


def _wall_s(loaded: LoadedPolicy) -> float | None:
    """Wall time (s) of the run until the checkpoint RUN/checkpoints/N, from the run's times."""
    run, last = loaded.path.parent.parent, loaded.metadata["iteration"]
    if not (run / FILE).is_file():
        return None
    times = [row["wall_s"] for row in read_metrics(run) if row["iteration"] <= last]
    return max(times, default=None)


def _commit() -> str | None:
    """The checkout's commit, with -dirty where it has changes; None outside of one."""
    command = ["git", "describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"]
    folder = Path(__file__).parent
    try:
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return f"{done.stdout.strip()} (of the checkout at the export)"


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="getup-export",
        description="Copy a run's policy to a folder of at most "
        f"{checkpoint.MAX_EXPORT_BYTES / 1e6:g} MB, and write its model card.",
    )
    add = parser.add_argument
    add(
        "run",
        metavar="RUN",
        help="a run folder, one checkpoint in it, the name of a shipped policy, or hf://OWNER/NAME",
    )
    add(
        "out",
        nargs="?",
        metavar="OUT",
        help="the folder to write, such as assets/checkpoints/flat, or hf://OWNER/NAME to upload "
        "it to the Hugging Face Hub; needs the extra hub",
    )
    add(
        "--onnx",
        type=output(".onnx"),
        metavar="FILE",
        help="the policy for programs without JAX: FILE, two more graphs and the MuJoCo model "
        "beside it; needs the extra onnx",
    )
    add(
        "--eval",
        type=Path,
        action="append",
        default=[],
        metavar="FILE",
        help="results of getup-eval --json for the card; may be given several times, and of one "
        "setting on several engines, which then stand side by side",
    )
    add("--machine", metavar="TEXT", help="what it was trained on, for the card")
    add(
        "--before",
        metavar="TEXT",
        help="for the card, where train.init_from began with a trained policy: its steps and time",
    )
    add("--commit", metavar="HASH", help="of the training's code (default: of this checkout)")
    return parser
