"""Control steps per second of training in one process and in two, each on a core of its own.

    python benchmarks/scaling.py [--config flat] [--num-envs 512] [--rounds 7] [--json FILE]

Five runs are compiled, wait, and then iterate in turn, again and again, so that a busy machine
slows all of them alike:

  one       one process on one core, N simulations
  two       two processes on a core each, N simulations each     (weak scaling: two / one)
  strong    two processes on a core each, N / 2 simulations each (strong scaling: strong / one)
  both      one process on both cores, 2 N simulations           (two / both)
  apart     two that are not joined, at once, N simulations each (apart / one: what the machine
            allows, whose cores share caches and memory, and two / apart: what joining costs)

With 2 N simulations the minibatches are twice as large, so that the updates are as many.

Reported are medians of the rounds and of the rounds' ratios, the bytes that an iteration reduces
over the processes and the time of a reduction, and what the formulas of docs/scale.md make of them.
Linux only: it pins processes to CPUs. Nothing else should run beside it.
"""

from __future__ import annotations

import argparse
import json
import os
import socket
import statistics
import subprocess
import sys
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from getup_jax.config import ConfigError
from getup_jax.config.load import load_config
from support.command import command, parser_of, positive
from support.projection import Iteration, Network, efficiency

QUICK_MINIBATCH = 16
LEAVE_S = 60
ETHERNET, NVLINK = Network(latency_s=50e-6, bytes_per_s=3e9), Network(10e-6, 2e11)
RATIOS = {
    "weak": ("two", "one"),
    "strong": ("strong", "one"),
    "of both cores": ("two", "both"),
    "of the machine": ("apart", "one"),
    "of two apart": ("two", "apart"),
}


def main() -> None:
    args = parse_args()
    cpus = sorted(os.sched_getaffinity(0))
    if len(cpus) < 2:
        print(f"skipped: needs 2 CPUs that this process may use, got {len(cpus)}")
        return
    size = args.num_envs or (8 if args.quick else load_config(args.config).ppo.num_envs)
    minibatch = QUICK_MINIBATCH if args.quick else load_config(args.config).ppo.minibatch_size
    one, two = [[cpus[0]]], [[cpus[0]], [cpus[1]]]
    runs: dict[str, Run] = {}
    try:
        for name, where, times, joined in (
            ("one", one, 1, True),
            ("two", two, 2, True),
            ("strong", two, 1, True),
            ("both", [cpus[:2]], 2, True),
            ("apart", two, 1, False),
        ):
            print(f"{name}: {times * size} simulations, compiling ...", flush=True)
            runs[name] = Run(args, where, times * size, times * minibatch, joined)
        seconds = {name: [] for name in runs}
        for _ in range(args.rounds):
            for name, run in runs.items():
                seconds[name].append(run.iterate())
    finally:
        for run in runs.values():
            run.close()
    result = report({name: run.about for name, run in runs.items()}, seconds)
    show(result)
    if args.json is not None:
        args.json.write_text(json.dumps(result, indent=2) + "\n")


class Run:
    """The processes of one run, on CPUs of their own; or of as many runs, if not joined."""

    def __init__(
        self,
        args: argparse.Namespace,
        cpus: list[list[int]],
        num_envs: int,
        minibatch: int,
        joined: bool,
    ) -> None:
        sizes = [f"ppo.num_envs={num_envs}", f"ppo.minibatch_size={minibatch}"]
        setting = {
            "config": args.config,
            "settings": [*args.settings, *sizes],
            "num_envs": num_envs,
            "num_steps": args.num_steps,
            "quick": args.quick,
        }
        options: list[str] = []
        if joined and len(cpus) > 1:
            address = f"127.0.0.1:{_free_port()}"
            options = ["--coordinator", address, "--processes", str(len(cpus)), "--process"]
        self._processes = []
        for index, own in enumerate(cpus):
            words = [json.dumps(setting), *options, *([str(index)] if options else [])]
            self._processes.append(_started(words, own))
        answers = [self._answer(process) for process in self._processes]
        self.about: dict[str, Any] = answers[0]
        if not joined:
            self.about["steps"] = sum(answer["steps"] for answer in answers)

    def iterate(self) -> float:
        """Seconds of one iteration: those of the slowest process."""
        for process in self._processes:
            process.stdin.write("go\n")
            process.stdin.flush()
        return max(self._answer(process) for process in self._processes)

    def close(self) -> None:
        """End the processes: they leave together once nobody asks for more."""
        for process in self._processes:
            process.stdin.close()
        for process in self._processes:
            try:
                process.wait(timeout=LEAVE_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def _answer(self, process: subprocess.Popen[str]) -> Any:
        assert process.stdout is not None
        for line in process.stdout:
            if not line.startswith("[Gloo]"):
                return json.loads(line)
        raise ConfigError(f"a process ended with code {process.wait()}; its message is above")


def report(about: dict[str, Any], seconds: dict[str, list[float]]) -> dict[str, Any]:
    """Plain values for JSON."""
    rates = {name: [about[name]["steps"] / s for s in times] for name, times in seconds.items()}
    ratios = {
        name: statistics.median(a / b for a, b in zip(rates[x], rates[y], strict=True))
        for name, (x, y) in RATIOS.items()
    }
    sizes, updates = about["one"]["parameters"], about["one"]["updates"]
    messages = max(updates.values())  # one has both gradients, while both learn
    of_one = Iteration(
        compute_s=statistics.median(seconds["one"]),
        gradient_bytes=4 * sum(size * updates[part] for part, size in sizes.items()) / messages,
        updates=messages,
    )
    return {
        "control steps/s": {name: statistics.median(found) for name, found in rates.items()},
        "ratios": ratios,
        "iteration": {**vars(of_one), "bytes": of_one.gradient_bytes * of_one.updates},
        "reduction_s": about["two"]["reduction_s"],
        "smallest_reduction_s": about["two"]["smallest_reduction_s"],
        "projected efficiency": {
            "64 hosts": efficiency(of_one, 64, ETHERNET),
            "8 devices": efficiency(of_one, 8, NVLINK),
        },
        "rounds": seconds,
    }


def show(result: dict[str, Any]) -> None:
    table = Table("run", "control steps/s", title="training, medians of the rounds")
    for name, rate in result["control steps/s"].items():
        table.add_row(name, f"{rate:,.0f}")
    console = Console(width=100)
    console.print(table)
    for name, ratio in result["ratios"].items():
        console.print(f"{name}: {' / '.join(RATIOS[name])} = {ratio:.2f}")
    found = result["iteration"]
    console.print(
        f"an iteration: {found['compute_s']:.2f} s alone, {found['updates']} messages of "
        f"{found['gradient_bytes'] / 1e6:.2f} MB; a reduction of the largest takes "
        f"{1e3 * result['reduction_s']:.2f} ms, of one number "
        f"{1e3 * result['smallest_reduction_s']:.2f} ms"
    )
    for name, share in result["projected efficiency"].items():
        console.print(f"projected, {name} with such iterations: {share:.0%} of linear")


def parse_args() -> argparse.Namespace:
    parser = parser_of(__doc__)
    add = parser.add_argument
    add("--num-envs", type=positive, metavar="N", help="simulations a process; default: config's")
    add("--num-steps", type=positive, default=32, metavar="N", help="of an iteration (default: 32)")
    add("--rounds", type=positive, default=7, metavar="R", help="(default: 7)")
    return parser.parse_intermixed_args()


def _started(words: list[str], cpus: list[int]) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "support.training_process", *words],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        cwd=Path(__file__).parent,
        preexec_fn=lambda: os.sched_setaffinity(0, cpus),
    )


def _free_port() -> int:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


if __name__ == "__main__":
    command(main)
