"""`getup-motion`: import, list and plot motions, and show the get-ups in a file."""

from __future__ import annotations

import argparse
import dataclasses
import functools
import json
import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from getup_jax.cli.motion_files import expanded, load_library, read_files
from getup_jax.cli.motion_report import FileReport, event_table, file_table, getup_table
from getup_jax.config import MotionConfig, PhysicsConfig
from getup_jax.core.output_file import make_folder, replacing, write_text
from getup_jax.evaluation.options import output
from getup_jax.motion.clips import MotionError
from getup_jax.motion.io.glb_writer import require_glb
from getup_jax.motion.io.takes import Take, write_takes
from getup_jax.motion.io.usd_writer import require_usd
from getup_jax.motion.retarget.cache import Result, write_npz
from getup_jax.physics.character import CharacterSpec, load_character

_EXAMPLES = """\
examples:
  getup-motion import mocap/ --out clips --json report.json
                                   read every motion file of a folder, retarget it, keep clips
  getup-motion import walk.bvh --names map.yaml --scale 0.01 --floor 0
  getup-motion events clips/fall.npz       when it lies, rises and stands
  getup-motion list authored clips/        get-ups that a config can train on
  getup-motion plot clips/ --out curves.png
  getup-motion glb clips/ --out clips.glb  the motions as animations of a mesh
  getup-motion plot authored --strategies --out strategies.png
"""

_EXIT = "exit code: 0 where every file was used, with warnings or without; 1 where one was not"
_FASTEST_HZ = 10_000
_PIPED = 200  # columns of a table that no terminal shows
_SOURCE = "authored, deepmimic, a folder or a file"


def main(argv: Sequence[str] | None = None) -> int:
    """Run a sub-command; 1 where a file failed, and MotionError where nothing can be done."""
    args = _parser().parse_args(argv)
    return args.run(args, load_character(PhysicsConfig(character=args.character)))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="getup-motion",
        description="Motion files to clips on the character, and the get-ups in them.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    load = _command(commands, "import", _import, "read and retarget motion files")
    load.add_argument("paths", nargs="+", type=Path, metavar="FILE|FOLDER")
    load.add_argument("--out", type=Path, help="folder for the clips (.npz); none: only a check")
    load.add_argument("--json", type=output(".json"), help="write the report as JSON")
    _add_reading(load)
    show = _command(commands, "list", _list, "the get-ups of motion sources")
    show.add_argument("sources", nargs="*", default=["authored"], metavar="SOURCE", help=_SOURCE)
    plot = _command(commands, "plot", _plot, "draw the style curves of motion sources")
    plot.add_argument("sources", nargs="+", metavar="SOURCE", help=_SOURCE)
    picture = output(".png", ".pdf", ".svg")
    plot.add_argument("--out", type=picture, required=True, metavar="PNG", help="the picture")
    plot.add_argument("--curves", nargs="*", default=[], metavar="NAME", help="only these get-ups")
    plot.add_argument(
        "--strategies", action="store_true", help="only mean and deviation of each strategy"
    )
    for name, text, suffixes in (
        ("glb", "get-ups as animations of a mesh, for Blender", (".glb",)),
        ("usd", "the same as USD, for Omniverse and Houdini", (".usd", ".usda", ".usdc")),
    ):
        scene = _command(commands, name, _scene, text)
        scene.add_argument("sources", nargs="+", metavar="SOURCE", help=_SOURCE)
        file = scene.add_argument("--out", type=output(*suffixes), required=True, metavar="FILE")
        file.help = "the file"
        scene.add_argument("--curves", nargs="*", default=[], metavar="NAME", help="only these")
    events = _command(commands, "events", _events, "the get-ups in one file")
    events.add_argument("paths", nargs=1, type=Path, metavar="FILE")
    _add_reading(events)
    return parser


def _command(commands: Any, name: str, run: Callable[..., int], text: str) -> Any:
    """The parser of a sub-command; `text` is its line in the list and its description."""
    parser = commands.add_parser(name, help=text, description=f"{text[0].upper()}{text[1:]}.")
    parser.epilog = _EXIT
    parser.add_argument("--character", default="humanoid49", help="name or MJCF file")
    parser.set_defaults(run=run)
    return parser


def _add_reading(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--allow-short",
        action="store_true",
        help="take BVH files with another number of rows than the header says; "
        "one row too few is only a warning, with the flag or without",
    )
    parser.add_argument("--names", type=Path, help="YAML or JSON map {joint: link}")
    parser.add_argument("--scale", type=_above_zero, help="metres in a unit of the file")
    parser.add_argument(
        "--up",
        choices=("auto", "y", "z"),
        default="auto",
        help="vertical axis of BVH and SMPL files (default: along which the body stands)",
    )
    parser.add_argument(
        "--source-fps",
        type=_rate,
        help="frames a second of BVH, AMC and SMPL files, in place of what they say (AMC: 120)",
    )
    parser.add_argument("--fps", type=_rate, default=30.0, help="rate of the clips (default: 30)")
    parser.add_argument("--floor", type=_finite, help="height of the recording's floor (m)")


def _finite(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"expected a number, got {text!r}")
    return value


def _above_zero(text: str) -> float:
    value = _finite(text)
    if not 1e-6 <= value <= 1e6:
        raise argparse.ArgumentTypeError(f"expected a number above 0, such as 0.01, got {text!r}")
    return value


def _rate(text: str) -> float:
    value = _finite(text)
    if not 1 <= value <= _FASTEST_HZ:
        raise argparse.ArgumentTypeError(
            f"expected frames a second, from 1 to {_FASTEST_HZ}, got {text!r}"
        )
    return value


def _import(args: argparse.Namespace, character: CharacterSpec) -> int:
    files = expanded(args.paths)
    keep = None
    if args.out:
        keep = functools.partial(_keep, make_folder(args.out), files, character)
    reports = read_files(args, files, character, keep)
    console = _wide()
    console.print(file_table(reports))
    _print_messages(console, reports)
    if args.json:
        plain = [report.plain() for report in reports]
        write_text(args.json, json.dumps(plain, indent=1) + "\n")
    return int(any(report.errors for report in reports))


def _keep(
    folder: Path, files: Sequence[Path], character: CharacterSpec, path: Path, result: Result
) -> None:
    """The clip of a file as an .npz; files of one name get their old suffix into the new name."""
    if isinstance(result, MotionError):
        return
    twin = [file.stem for file in files].count(path.stem) > 1
    name = path.name.replace(".", "_") if twin else path.stem
    clip, report = result
    clip = dataclasses.replace(clip, name=name)
    with replacing(folder / f"{name}.npz") as part:
        write_npz(part, clip, report, character)


def _wide() -> Console:
    """The standard output; a file or a pipe has no width that would cut a table."""
    return Console() if sys.stdout.isatty() else Console(width=_PIPED)


def _events(args: argparse.Namespace, character: CharacterSpec) -> int:
    (report,) = read_files(args, args.paths, character)
    console = _wide()
    if report.clip:
        console.print(event_table(report, report.clip.fps))
    _print_messages(console, [report])
    return int(bool(report.errors))


def _list(args: argparse.Namespace, character: CharacterSpec) -> int:
    library = load_library(MotionConfig(source=tuple(args.sources)), character)
    console = _wide()
    console.print(getup_table(library.getups))
    console.print(f"{len(library.poses)} poses for the pose prior, mirror images included")
    return 0


def _plot(args: argparse.Namespace, character: CharacterSpec) -> int:
    from getup_jax.motion.getup.plot import plot_getups, plot_strategies

    config = MotionConfig(source=tuple(args.sources), curves=tuple(args.curves))
    library = load_library(config, character)
    if args.strategies:
        plot_strategies(library.getups, character, args.out)
    else:
        plot_getups(library.getups, character, args.out)
    Console().print(f"{args.out}: {len(library.getups)} get-ups")
    return 0


def _scene(args: argparse.Namespace, character: CharacterSpec) -> int:
    require = require_glb if args.out.suffix.lower() == ".glb" else require_usd
    require()
    config = MotionConfig(source=tuple(args.sources), curves=tuple(args.curves))
    clips = [getup.clip for getup in load_library(config, character).getups if getup.clip]
    takes = [Take(clip.name, clip.fps, clip.qpos) for clip in clips]
    if not takes:
        raise MotionError(f"{', '.join(args.sources)}: expected motions, found curves alone")
    write_takes(args.out, character, takes)
    Console().print(f"{args.out}: {len(takes)} motions", soft_wrap=True)
    return 0


def _print_messages(console: Console, reports: list[FileReport]) -> None:
    for report in reports:
        for text in report.warnings:
            console.print(f"warning: {report.path.name}: {text}", style="yellow", soft_wrap=True)
        for text in report.errors:
            console.print(f"error: {text}", style="red", soft_wrap=True)
