"""The same task, trained by other people's trainers and by ours, in turn on one machine.

    pip install 'getup-jax[peers]'
    python benchmarks/peers.py --json rates.json                  # samples/s on configs/flat.yaml
    python benchmarks/peers.py --config quick --success .9        # wall time to success

  ours      getup-train: native MuJoCo inside jit
  sb3       stable-baselines3's PPO on our VectorEnv
  sb3:N     the same PPO on N processes, each with one MuJoCo simulation in NumPy (SubprocVecEnv)
  brax      Brax's PPO on MJX, with our functional environment inside

Every trainer is a process of its own, that does one training iteration when it is its turn, so that
a busy machine slows all of them alike. Same character, rates, observation, action, reward, network
and PPO sizes; docs/peers.md says what is not the same. Reported are the median samples/s of the
iterations, collecting and learning together, the median of the rounds' ratios of ours to each, and
of sb3:N the best N. --success S goes on until a share S of an iteration's episodes succeeds.
Peers that are not installed are a line.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from getup_jax.config import ConfigError
from getup_jax.config.load import load_config
from support.command import command, duration, parser_of, positive

OURS = "ours"
PEERS = (OURS, "sb3", "sb3:2", "sb3:4", "sb3:8", "sb3:16", "brax")
QUICK_PEERS = (OURS, "sb3:2", "sb3")
WARM_UP = 1  # iterations, in which some compile
LEAVE_S = 20


def main() -> None:
    args = parse_args()
    config = load_config(args.config, args.settings)
    with tempfile.TemporaryDirectory() as folder:
        if any(":" in name for name in args.peers):
            _write_task(Path(folder), args)
        peers: dict[str, Peer] = {}
        try:
            for name in args.peers:
                print(f"{name}: starting ...", flush=True)
                peers[name] = Peer(name, setting_of(name, args, config, folder))
            there = _left(peers)
            if args.success is None:
                rounds = WARM_UP + args.rounds
                for number in range(rounds):
                    _round(there, f"round {number + 1} of {rounds}")
            else:
                reach(there, args.success, args.limit_s)
        finally:
            for peer in peers.values():
                peer.close()
    result = report(args, peers)
    show(result)
    if args.json is not None:
        args.json.write_text(json.dumps(result, indent=2) + "\n")


def setting_of(name: str, args: argparse.Namespace, config: Any, folder: str) -> dict[str, Any]:
    """What a peer is told: config and sizes.

    Processes of one simulation, and Brax on a CPU, take so long for a rollout of the config's size
    that rates are measured with a shorter one, of `--samples`, with updates of the same size.
    """
    ppo = config.ppo
    envs, steps, minibatch = ppo.num_envs, ppo.num_steps, ppo.minibatch_size
    if args.quick:
        envs, steps, minibatch = 8, 8, 16
    elif args.success is None and name != OURS and name != "sb3":
        envs, steps = max(1, args.samples // steps), steps
        minibatch = math.gcd(minibatch, envs * steps)
    return {
        "config": args.config,
        "settings": args.settings,
        "num_envs": envs,
        "num_steps": steps,
        "minibatch_size": minibatch,
        "folder": folder,
    }


class Peer:
    """A trainer in a process, and what it has answered."""

    def __init__(self, name: str, setting: dict[str, Any]) -> None:
        self.name, begin = name, time.monotonic()
        self.iterations: list[dict[str, Any]] = []
        self.missing: str | None = None
        self._process = _started(name, setting)
        answer = self._answer()
        self.ready_s = time.monotonic() - begin
        if answer is not None and "missing" in answer:
            self.missing = f"not installed: {answer['missing']}"

    def iterate(self) -> None:
        """One training iteration; where it breaks, `missing` says so."""
        assert self._process.stdin is not None
        self._process.stdin.write("go\n")
        self._process.stdin.flush()
        answer = self._answer()
        if answer is not None:
            self.iterations.append(answer)

    @property
    def seconds(self) -> float:
        """From the start of the process, without what others did meanwhile."""
        return self.ready_s + sum(x["seconds"] for x in self.iterations)

    def rates(self) -> list[float]:
        """Samples/s of every iteration after the warm-up."""
        return [x["samples"] / x["seconds"] for x in self.iterations[WARM_UP:]]

    def close(self) -> None:
        """End the process."""
        if self._process.stdin is not None:
            self._process.stdin.close()
        try:
            self._process.wait(timeout=LEAVE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _answer(self) -> dict[str, Any] | None:
        """What the process says; None where it has ended, and `missing` is set."""
        assert self._process.stdout is not None
        for line in self._process.stdout:
            if line.startswith("{"):
                return json.loads(line)
        code = self._process.wait()
        if self.name == OURS:
            raise ConfigError(f"{self.name}: ended with code {code}; its message is above")
        self.missing = f"ended with code {code}; its message is above"
        print(f"{self.name}: {self.missing}", flush=True)
        return None


def _left(peers: dict[str, Peer]) -> dict[str, Peer]:
    return {name: peer for name, peer in peers.items() if peer.missing is None}


def _round(peers: dict[str, Peer], text: str) -> None:
    for name, peer in _left(peers).items():
        peer.iterate()
        if peer.missing is not None:
            continue
        last = peer.iterations[-1]
        print(f"{text}: {name} {last['samples'] / last['seconds']:,.0f} samples/s", flush=True)


def reach(peers: dict[str, Peer], share: float, limit_s: float) -> None:
    """Iterations in turn until every peer had that share of success, or its time is over."""
    waiting = dict(peers)
    while waiting:
        for name, peer in list(waiting.items()):
            peer.iterate()
            if peer.missing is not None:
                del waiting[name]
                continue
            success = peer.iterations[-1]["success"]
            done = success is not None and success >= share
            so_far = "no episode yet" if success is None else f"success {success:.0%}"
            word = "reached it" if done else "gives up" if peer.seconds > limit_s else "goes on"
            print(f"{name}: {so_far} after {peer.seconds:.0f} s, {word}", flush=True)
            if done or peer.seconds > limit_s:
                del waiting[name]


def report(args: argparse.Namespace, peers: dict[str, Peer]) -> dict[str, Any]:
    """Plain values for JSON."""
    found: dict[str, Any] = {}
    for name, peer in peers.items():
        if peer.missing is not None:
            found[name] = {"missing": peer.missing}
            continue
        found[name] = {"ready_s": peer.ready_s, "iterations": peer.iterations}
        if args.success is None:
            found[name] |= _rates(peer, peers.get(OURS))
        else:
            success = peer.iterations[-1]["success"]
            samples = sum(x["samples"] for x in peer.iterations)
            found[name] |= {"success": success, "seconds": peer.seconds, "samples": samples}
            found[name]["reached"] = success is not None and success >= args.success
    return {"config": args.config, "settings": args.settings, "peers": found}


def _rates(peer: Peer, ours: Peer | None) -> dict[str, Any]:
    rates = peer.rates()
    result: dict[str, Any] = {"samples_per_s": statistics.median(rates)}
    if ours is not None and ours.missing is None:
        pairs = zip(ours.rates(), rates, strict=True)
        result["ours_by_it"] = statistics.median(a / b for a, b in pairs)
    return result


def best_of_processes(peers: dict[str, Any]) -> str | None:
    """The sb3:N with the most samples/s."""
    rates = {n: p["samples_per_s"] for n, p in peers.items() if ":" in n and "samples_per_s" in p}
    return max(rates, key=lambda name: rates[name]) if rates else None


def show(result: dict[str, Any]) -> None:
    peers, best = result["peers"], best_of_processes(result["peers"])
    table = Table("trainer", "samples/s", "ours / it", "success", "wall s", "samples")
    cells: tuple[tuple[str, Callable[[Any], str]], ...] = (
        ("samples_per_s", lambda x: f"{x:,.0f}"),
        ("ours_by_it", lambda x: f"{x:.1f}"),
        ("success", lambda x: "-" if x is None else f"{x:.0%}"),
        ("seconds", lambda x: f"{x:,.0f}"),
        ("samples", lambda x: f"{x:,}"),
    )
    for name, row in peers.items():
        if "missing" in row:
            table.add_row(name, row["missing"])
            continue
        label = f"{name} (best)" if name == best else name
        if row.get("reached") is False:
            label += " (gave up)"
        table.add_row(label, *(write(row[key]) if key in row else "" for key, write in cells))
    Console(width=110).print(table)


def _write_task(folder: Path, args: argparse.Namespace) -> None:
    """The task for processes that know nothing of JAX."""
    import dataclasses

    from getup_jax.envs.getup.build import build_task
    from support.task_file import write_task

    config = load_config(args.config, [*args.settings, "physics.engine=native"])
    config = dataclasses.replace(config, curriculum=None)
    write_task(folder, build_task(config, print), config)


def _started(name: str, setting: dict[str, Any]) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "support.peer_process", name, json.dumps(setting)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        cwd=Path(__file__).parent,
    )


def parse_args() -> argparse.Namespace:
    parser = parser_of(__doc__)
    add = parser.add_argument
    add("--peers", nargs="+", choices=PEERS, metavar="PEER", help=f"(default: {' '.join(PEERS)})")
    add("--rounds", type=positive, default=5, metavar="R", help="iterations of each (default: 5)")
    add("--samples", type=positive, default=2048, metavar="N", help="a rollout (default: 2048)")
    add("--success", type=_share, metavar="S", help="train until so many succeed, such as .9")
    add("--limit-s", type=duration, default=3600.0, metavar="S", help="(default: 3600)")
    args = parser.parse_intermixed_args()
    args.peers = tuple(args.peers or (QUICK_PEERS if args.quick else PEERS))
    if args.quick:
        args.rounds = min(args.rounds, 2)
        args.settings = [*args.settings, "task.pool_size=64"]
    return args


def _share(text: str) -> float:
    number = duration(text)
    if not 0.0 < number <= 1.0:
        raise argparse.ArgumentTypeError(f"expected a share above 0, at most 1, got {text!r}")
    return number


if __name__ == "__main__":
    command(main)
