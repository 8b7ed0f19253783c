"""How many falls of composite policies a get-up policy of the same body gets up from.

    python benchmarks/recovery.py runs/getup28 [--ckpt walk walk_aim wave_squat] [--falls 100]

A policy acts, is pushed to a random side as by the page that steers it (1.5 m/s of the whole body),
again and again until it falls, lies limp for a second, and the get-up policy takes over, all as in
`getup-edit --ckpt walk --getup RUN`. A fall counts as got up from if the body stood for half a
second without being put back on its feet. The falls are shared by the policies of --ckpt, which
must all be of the body that the get-up policy has, perhaps under other names.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import time

import numpy as np

from getup_jax.editor.steer.character import Character
from getup_jax.editor.steer.policies import Policies, choose
from getup_jax.evaluation.metrics import wilson
from getup_jax.evaluation.options import natural, output
from getup_jax.runtime.checkpoint import load_policy
from support.command import command, positive

_EVERY_STEPS = 20  # control steps between two pushes
_LONGEST_STEPS = 3000  # until it has fallen and stands again, or is put back


def main() -> None:
    """Print how many of the falls of every policy ended on its feet."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("getup", nargs="?", metavar="RUN", help="what `getup-eval --ckpt` takes: gets up")
    add("--ckpt", nargs="+", default=["walk", "walk_aim", "wave_squat"], help="what falls")
    add("--falls", type=positive, default=100, help="in all (default: 100)")
    add("--seed", type=natural, default=0)
    add("--json", type=output(".json"), metavar="FILE", help="write the result to this file")
    add("--quick", action="store_true", help="for `make bench`: one fall")
    args = parser.parse_args()
    if args.getup is None:
        print("skipped: needs a run folder of a get-up policy for the body of composite motion")
        return
    first, *others = args.ckpt
    policies = choose(first, load_policy(first), others, args.getup)
    policies.build(print)
    falls = 1 if args.quick else args.falls
    stood = measure(policies, args.ckpt, falls, args.seed)
    for name, results in stood.items():
        print(line(name, results))
    everything = list(itertools.chain(*stood.values()))
    print(line("all", everything))
    if args.json is not None:
        args.json.write_text(json.dumps({"getup": args.getup, "stood": stood}, indent=1) + "\n")


def measure(policies: Policies, names: list[str], falls: int, seed: int) -> dict[str, list[bool]]:
    """Whether it stood up, for every fall of every policy."""
    stood: dict[str, list[bool]] = {name: [] for name in names}
    rng, began = np.random.default_rng(seed), time.monotonic()
    characters = {
        name: Character({name: policies.players[name]}, policies.rising, seed) for name in names
    }
    for number in range(falls):
        name = names[number % len(names)]
        stood[name].append(fall(characters[name], rng))
        done, passed = number + 1, time.monotonic() - began
        left = passed / done * (falls - done)
        print(f"{done} of {falls} falls, {left:.0f} s left", end="\r", flush=True)
    print()
    return stood


def fall(character: Character, rng: np.random.Generator) -> bool:
    """Push it until it falls, and see whether it stands up by itself."""
    character.restart()
    phase = "acts"
    for step in range(_LONGEST_STEPS):
        if phase == "acts" and step % _EVERY_STEPS == _EVERY_STEPS - 1:
            character.push(rng.uniform(0.0, 2.0 * math.pi))
        before, said = phase, character.step().said
        phase = said["phase"]
        if before == "rises" and phase != "rises":
            return "put back" not in said["words"]
    return False


def line(name: str, stood: list[bool]) -> str:
    """One row of the result, with its 95 % interval."""
    if not stood:
        return f"{name:12}  no fall"
    low, high = wilson(sum(stood), len(stood))
    share = sum(stood) / len(stood)
    return f"{name:12} {share:6.1%} ({low:.0%} to {high:.0%}) of {len(stood)} falls got up from"


if __name__ == "__main__":
    command(main)
