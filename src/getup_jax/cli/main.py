"""The commands getup-train, -eval, -bench, -export, -motion, -edit and -search.

What imports JAX is imported where it is used, after the arguments and the settings were
checked, so that a typing mistake is answered at once.
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path

from getup_jax import __version__
from getup_jax.cli.process_options import add_options, group_of
from getup_jax.config.load import find_config, load_config
from getup_jax.editor.options import parse as parse_edit
from getup_jax.evaluation.options import bench_parser, eval_parser
from getup_jax.runtime import run_folder

_TRAIN_EXAMPLES = """\
examples:
  getup-train configs/flat.yaml                        train; writes into runs/flat
  getup-train configs/flat.yaml --resume               continue where it stopped
  getup-train flat ppo.num_envs=256 seed=1 --run runs/seed1
                                                       change settings, keep the file
  getup-train composite_wave_squat                     composite motion, see docs/composite.md
  getup-train flat --coordinator 10.0.0.1:4711 --processes 2 --process 0
                                                       on two machines, see docs/scale.md

All devices of the machine are used. A run folder holds config.yaml (every setting), metrics.jsonl
and times.jsonl (one line an iteration) and checkpoints/. Ctrl-C, SIGTERM and closing the terminal
save and exit; a second Ctrl-C exits at once.
"""


def train_main(argv: Sequence[str] | None = None) -> int:
    """`getup-train`; returns the exit code."""
    return _guard(_train, _train_parser().parse_intermixed_args(argv))


def eval_main(argv: Sequence[str] | None = None) -> int:
    """`getup-eval`; returns the exit code."""
    return _guard(_evaluate, eval_parser().parse_args(argv))


def bench_main(argv: Sequence[str] | None = None) -> int:
    """`getup-bench`; returns the exit code."""
    return _guard(_bench, bench_parser().parse_args(argv))


def export_main(argv: Sequence[str] | None = None) -> int:
    """`getup-export`; returns the exit code."""
    return _guard(_export, argv)


def search_main(argv: Sequence[str] | None = None) -> int:
    """`getup-search`; returns the exit code."""
    return _guard(_search, argv)


def motion_main(argv: Sequence[str] | None = None) -> int:
    """`getup-motion`; returns the exit code."""
    return _guard(_motion, argv)


def edit_main(argv: Sequence[str] | None = None) -> int:
    """`getup-edit`; returns the exit code."""
    return _guard(_edit, parse_edit(argv))


def _train(args: argparse.Namespace) -> int:
    config = load_config(args.config, args.overrides)
    folder = args.run or Path("runs") / find_config(args.config).stem
    group = group_of(args)
    if group.alone:
        run_folder.check(folder, args.resume)
    if not args.quiet and not group.process:
        print(f"getup-train {__version__}: {args.config} into {folder}", flush=True)

    def train() -> int:
        from getup_jax.training.run import run

        number = run(config, folder, args.resume, args.quiet)
        return 0 if number is None else 128 + number

    if group.alone:
        return train()
    from getup_jax.cli.many import together

    return together(group, train)


def _evaluate(args: argparse.Namespace) -> int:
    if any(x is not None for x in (args.video, args.plot, args.turntable)):
        _render_without_display()
    from getup_jax.cli.evaluate import evaluate_command

    return evaluate_command(args) or 0


def _bench(args: argparse.Namespace) -> int:
    from getup_jax.cli.bench import bench_command

    return bench_command(args)


def _export(argv: Sequence[str] | None) -> int:
    from getup_jax.release.export import main

    return main(argv)


def _search(argv: Sequence[str] | None) -> int:
    from getup_jax.cli.search import parser, search_command

    return search_command(parser().parse_intermixed_args(argv))


def _motion(argv: Sequence[str] | None) -> int:
    from getup_jax.cli.motion import main

    return main(argv) or 0


def _edit(args: argparse.Namespace) -> int:
    _render_without_display()
    os.environ.setdefault("JAX_PLATFORMS", "cpu")  # one character at a time is for a CPU
    from getup_jax.editor.server import edit_command

    return edit_command(args)


def _render_without_display() -> None:
    """Choose MuJoCo's renderer; it reads the choice when it is imported, so not later than now."""
    if sys.platform == "linux" and not {"DISPLAY", "WAYLAND_DISPLAY"} & os.environ.keys():
        os.environ.setdefault("MUJOCO_GL", "egl")


def _guard(command: Callable[..., int], argument: object) -> int:
    """Run a command; our errors and Ctrl-C are one line for the user, other errors a traceback."""
    warnings.showwarning = _show_warning
    try:
        return command(argument)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 128 + signal.SIGINT
    except ValueError as error:
        # ConfigError, CheckpointError, MotionError and the like: all written for the user.
        if not type(error).__module__.startswith("getup_jax."):
            raise
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        return 2


def _show_warning(message: Warning | str, *_: object) -> None:
    print(f"warning: {message}", file=sys.stderr)


def _train_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="getup-train",
        description="Train a policy that gets up from the floor.",
        epilog=_TRAIN_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("config", metavar="CONFIG", help="a YAML file, or the name of a shipped one such as flat")
    add(
        "overrides",
        metavar="key=value",
        nargs="*",
        help="settings that replace the file's, such as ppo.num_envs=256; all of them, with "
        "their defaults and meaning, are in getup_jax/config/",
    )
    add("--run", type=Path, metavar="FOLDER", help="the run's folder (default: runs/NAME)")
    add("--resume", action="store_true", help="continue the run that is in the folder, if any")
    add("--quiet", action="store_true", help="print only warnings and errors")
    add_options(parser)
    return parser
