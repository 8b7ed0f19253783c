"""The arguments of `getup-eval`; a bad value is answered before anything heavy is imported."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from pathlib import Path

from getup_jax.core.resources import DEFAULT_POLICY
from getup_jax.evaluation.own_ground import GROUND_HELP, own_ground

_EXAMPLES = """\
examples:
  getup-eval                                           the shipped policy
  getup-eval --ckpt runs/flat --episodes 200           the newest checkpoint of a run
  getup-eval --ckpt runs/flat --video getup.mp4 --plot getup.png
                                                       film it, and draw its curves
  getup-eval --start-noise 0.1 --duration-scale 0.8,1.2
                                                       other start poses, faster and slower
  getup-eval --blend --push 20                         curves never seen, and pushes
  getup-eval --ckpt terrain --drops paper              bodies dropped as the papers do
  getup-eval --edits 8                                 how well it obeys changes of its curves
  getup-eval --curves my_rise.yaml                     a style from getup-edit
  getup-eval --motions configs/flat_lafan1.yaml        recorded get-ups that it has never seen

Every start has a random heading. Without --start-noise, episodes of one style differ in
nothing else, so that more of them say little more.
"""


def eval_parser() -> argparse.ArgumentParser:
    """The parser of `getup-eval`."""
    parser = argparse.ArgumentParser(
        prog="getup-eval",
        description="Let a trained policy get up many times, and report how well it does.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add_checkpoint(parser)
    add(
        "--episodes",
        type=positive,
        metavar="N",
        help="how many (default: 100, on irregular ground 100 in each region; with --curves one "
        "a curve and region)",
    )
    add("--seed", type=natural, default=0, metavar="S", help="of the starts (default: 0)")
    add("--start", choices=("lying", "standing"), default="lying", help="(default: lying)")
    add("--stand-time", type=above_zero, metavar="S", help="seconds of standing (as trained)")
    add(
        "--terrain-seed",
        type=natural,
        metavar="S",
        help="another irregular ground of the same kind (default: that of the training)",
    )
    add("--ground", type=own_ground, metavar="FILE:SIDE[:HEIGHT]", help=GROUND_HELP)
    add(
        "--script",
        type=Path,
        metavar="FILE",
        help="composite motion: steer one character by the commands of a YAML file, see "
        "docs/composite.md",
    )
    add("--engine", metavar="E", help="native, mjx or mjx-warp (default: as for training)")
    _add_conditions(parser.add_argument_group("harder conditions, each off by default"))
    _add_outputs(parser.add_argument_group("output files"))
    return parser


_BENCH_EXAMPLES = """\
examples:
  getup-bench flat --quick                 a minute, to see that a policy runs
  getup-bench runs/mine --json mine.json   the whole benchmark
  getup-bench mine.onnx                    a policy of getup-export, or one graph; docs/bench.md
  getup-bench my_policies:Crawl            a function or class in my_policies.py
"""


def bench_parser() -> argparse.ArgumentParser:
    """The parser of `getup-bench`."""
    parser = argparse.ArgumentParser(
        prog="getup-bench",
        description="Let a policy get up from fixed starts, on fixed grounds, with pushes; success "
        "is told by our rule, by those of the papers that it is after, and by HoST's.",
        epilog=_BENCH_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add(
        "policy",
        metavar="POLICY",
        help="a shipped policy's name, a run folder, a checkpoint, hf://OWNER/NAME, an .onnx "
        "file, or MODULE:FUNCTION",
    )
    add("--quick", action="store_true", help="one round of one suite")
    add("--json", type=output(".json"), metavar="FILE", help="the results; a .json file")
    add("--engine", metavar="E", help="native, mjx or mjx-warp (default: as for training)")
    return parser


def add_checkpoint(parser: argparse.ArgumentParser) -> None:
    """The argument --ckpt."""
    parser.add_argument(
        "--ckpt",
        metavar="PATH",
        default=DEFAULT_POLICY,
        help="a run folder, a checkpoint, the name of a shipped policy, or hf://OWNER/NAME on the "
        f"Hugging Face Hub (default: {DEFAULT_POLICY})",
    )


def _add_conditions(group: argparse._ArgumentGroup) -> None:
    add = group.add_argument
    add(
        "--start-noise",
        type=at_least_zero,
        default=0.0,
        metavar="RAD",
        help="standard deviation of the noise on every hinge of the start poses",
    )
    add(
        "--duration-scale",
        type=low_high,
        default=(1.0, 1.0),
        metavar="LOW,HIGH",
        help="each episode's curves last T x U(LOW, HIGH), such as 0.8,1.2",
    )
    add(
        "--drops",
        choices=("paper", "limp", "any", "varied", "fallen"),
        help="how bodies came to lie, on flat ground too: paper: dropped prone or supine in the "
        "neutral pose, with weak servos; limp: prone, supine or on a side, all hinges bent at "
        "random, servos off; any: limp in every orientation; varied: half any, half paper; "
        "fallen: pushed over (default: the motions' first poses on flat ground, limp elsewhere)",
    )
    styles = group.add_mutually_exclusive_group()
    styles.add_argument(
        "--curves",
        nargs="+",
        type=Path,
        metavar="FILE",
        help="the styles in these curve files in place of the trained ones, each from the first "
        "pose of the motion that it names; what getup-edit saves and shows",
    )
    styles.add_argument(
        "--motions",
        type=Path,
        metavar="CONFIG|FILE",
        help="the get-ups that the `motion` section of another config names, or those in a motion "
        "file, in place of the trained ones",
    )
    styles.add_argument(
        "--blend",
        nargs="?",
        choices=("half", "random"),
        const="half",
        help="follow mixtures of two curves that start alike: half and half, or with a random "
        "weight for every pair",
    )
    add(
        "--edits",
        type=positive,
        metavar="N",
        help="also N small random edits of each curve: how much of what they ask for is done",
    )
    add(
        "--push",
        type=above_zero,
        metavar="NS",
        help="an impulse (Ns) to the chest in a random horizontal direction, about a second "
        "after the curve's end",
    )


def _add_outputs(group: argparse._ArgumentGroup) -> None:
    add = group.add_argument
    add("--json", type=output(".json"), metavar="FILE", help="the results; a .json file")
    add(
        "--video",
        type=output(".mp4"),
        metavar="FILE",
        help="a typical episode of several styles; an .mp4 file",
    )
    add(
        "--size",
        type=_size,
        default=(720, 1280),
        metavar="WxH",
        help="of the film in pixels, even numbers (default: 1280x720)",
    )
    add(
        "--turntable",
        type=output(".png", ".jpg"),
        metavar="FILE",
        help="a typical episode at four moments from six sides; a .png or .jpg file",
    )
    add(
        "--glb",
        type=output(".glb"),
        metavar="FILE",
        help="the same episodes as animations of a mesh, for Blender and browsers; a .glb file",
    )
    add(
        "--usd",
        type=output(".usd", ".usda", ".usdc"),
        metavar="FILE",
        help="the same as USD, one after the other on its time line; .usd, .usda or .usdc",
    )
    add(
        "--plot",
        type=output(".png", ".pdf", ".svg"),
        metavar="FILE",
        help="target and achieved curves of several styles, with pictures; of composite motion "
        "the weights of a meta policy by body part; .png, .pdf or .svg",
    )


def positive(text: str) -> int:
    """A whole number of at least 1."""
    return _whole(text, 1)


def natural(text: str) -> int:
    """A whole number of at least 0."""
    return _whole(text, 0)


def _whole(text: str, least: int) -> int:
    try:
        number = int(text)
    except ValueError:
        number = least - 1
    if number < least:
        raise argparse.ArgumentTypeError(f"expected a whole number, at least {least}, got {text!r}")
    return number


def at_least_zero(text: str) -> float:
    """A finite number of at least 0."""
    return _number(text, lambda x: x >= 0, "a number, at least 0")


def above_zero(text: str) -> float:
    """A finite number above 0."""
    return _number(text, lambda x: x > 0, "a number above 0")


def low_high(text: str) -> tuple[float, float]:
    """Two numbers above 0 with a comma between them, the smaller one first."""
    parts = text.split(",")
    expected = "LOW,HIGH with 0 < LOW <= HIGH, such as 0.8,1.2"
    low, high = (
        _number(part, lambda x: x > 0, expected)
        for part in (parts if len(parts) == 2 else ("", ""))
    )
    if low > high:
        raise argparse.ArgumentTypeError(f"expected {expected}, got {text!r}")
    return low, high


def _size(text: str) -> tuple[int, int]:
    """Rows and columns of WIDTHxHEIGHT; film formats want even numbers."""
    width, _, height = text.partition("x")
    found = [int(x) if x.isascii() and x.isdigit() else 0 for x in (height, width)]
    if not all(16 <= x <= 4096 and x % 2 == 0 for x in found):
        raise argparse.ArgumentTypeError(
            f"expected WIDTHxHEIGHT in even numbers from 16 to 4096, such as 1280x720, got {text!r}"
        )
    return found[0], found[1]


def _number(text: str, fits: Callable[[float], bool], expected: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not (math.isfinite(number) and fits(number)):
        raise argparse.ArgumentTypeError(f"expected {expected}, got {text!r}")
    return number


def output(*suffixes: str) -> Callable[[str], Path]:
    """A file with one of the suffixes, in a folder that exists."""

    def check(text: str) -> Path:
        path = Path(text)
        if path.suffix.lower() not in suffixes:
            expected = " or ".join(suffixes)
            raise argparse.ArgumentTypeError(
                f"expected a file that ends in {expected}, got {text!r}"
            )
        if not path.parent.is_dir():
            raise argparse.ArgumentTypeError(f"no folder {path.parent}; make it first")
        return path

    return check
