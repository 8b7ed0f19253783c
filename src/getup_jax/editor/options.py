"""The arguments of `getup-edit`; a bad value is answered before anything heavy is imported."""

from __future__ import annotations

import argparse
import ipaddress
import sys
from collections.abc import Sequence

from getup_jax.evaluation.options import add_checkpoint

PORT = 8421
_TOKEN = 12  # characters at least

_EXAMPLES = """\
examples:
  getup-edit                                the shipped policy, on http://127.0.0.1:8421
  getup-edit --ckpt runs/flat --port 9000   the newest checkpoint of a run
  getup-edit --ckpt walk                    steer a policy of composite motion: click where to go
  getup-edit --ckpt walk --with walk_aim runs/mine
                                            policies to switch between while it moves
  getup-edit --host 0.0.0.0 --token "$(openssl rand -hex 16)"
                                            for other machines; give them the address it prints

Saved curves are small YAML files: evaluate them with getup-eval --curves FILE, train on them with
motion.source=[authored,FILE]. Ctrl-C ends the server.
"""


def edit_parser() -> argparse.ArgumentParser:
    """The parser of `getup-edit`."""
    parser = argparse.ArgumentParser(
        prog="getup-edit",
        description="Draw the curves of a get-up in a page, and watch the physics follow them; or "
        "steer a character that walks.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add_checkpoint(parser)
    add(
        "--with",
        dest="others",
        nargs="+",
        action="extend",
        default=[],
        metavar="PATH",
        help="composite motion: more policies of the same character, to switch to; the shipped "
        "ones that fit are offered anyway",
    )
    add(
        "--getup",
        metavar="PATH",
        help="composite motion: the policy that gets the character up after a fall",
    )
    add("--port", type=port, default=PORT, metavar="N", help=f"(default: {PORT}; 0: a free one)")
    add(
        "--host",
        default="127.0.0.1",
        metavar="ADDRESS",
        help="address to serve on (default: this machine alone); another one needs --token",
    )
    add("--token", type=token, metavar="TEXT", help="what pages must know; part of their address")
    return parser


def parse(argv: Sequence[str] | None = None) -> argparse.Namespace:
    """The checked arguments."""
    parser = edit_parser()
    args = parser.parse_args(argv)
    given = [a for a in (sys.argv[1:] if argv is None else argv) if a.partition("=")[0] == "--ckpt"]
    if len(given) > 1:
        parser.error("--ckpt: expected one policy, the first; name the others after --with")
    if not is_loopback(args.host) and args.token is None:
        parser.error(f"--host {args.host}: other machines could reach it; give a --token as well")
    return args


def is_loopback(host: str) -> bool:
    """Whether only this machine reaches the address."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def port(text: str) -> int:
    """A port number."""
    number = int(text) if text.isdecimal() else -1
    if not 0 <= number < 65536:
        raise argparse.ArgumentTypeError(f"expected a port from 0 to 65535, got {text!r}")
    return number


def token(text: str) -> str:
    """A secret that fits into an address."""
    if len(text) < _TOKEN or not all(c.isalnum() or c in "-_" for c in text) or not text.isascii():
        raise argparse.ArgumentTypeError(
            f"expected at least {_TOKEN} letters and digits, got {len(text)} characters"
        )
    return text
