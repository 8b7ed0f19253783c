"""The options of `getup-train` for a run of many processes; see docs/scale.md."""

from __future__ import annotations

import argparse

from getup_jax.runtime.process_group import DEFAULT_WAIT_S, Group


def group_of(args: argparse.Namespace) -> Group:
    """What the options say; raises ProcessError."""
    return Group(args.coordinator, args.processes, args.process, args.distributed, args.wait)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add them; `group_of` reads them."""
    group = parser.add_argument_group(
        "many machines", "one process each; SLURM and MPI steps of several tasks need no option"
    )
    add = group.add_argument
    add("--coordinator", metavar="HOST:PORT", help="where the first process listens")
    add("--processes", type=int, metavar="N", help="how many processes the run has")
    add("--process", type=int, metavar="I", help="which one this is, from 0; it logs and writes")
    add(
        "--distributed",
        action="store_true",
        help="JAX detects the processes: SLURM, Open MPI, Kubernetes, TPU",
    )
    add(
        "--wait",
        type=float,
        default=DEFAULT_WAIT_S,
        metavar="S",
        help="seconds for all processes to come (default: %(default)g)",
    )
