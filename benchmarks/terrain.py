"""Speed on irregular ground: the native engine on a height field against the plane, as a ratio.

    python benchmarks/terrain.py [--json FILE] [--sims 256] [--seconds 20] [--drops N] [--quick]

Lying characters under random hinge targets, the same number everywhere: on the plane, and in every
region of the ground of configs/terrain.yaml. All are timed in turn again and again, so that a busy
machine slows all of them alike; the median of the rounds' ratios is what counts. With them come the
look-ups of one control step, those of the height map and the head, as the task makes them inside
jit. --drops N also times N rag-dolls that fall and come to rest (without the cache).
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from pathlib import Path
from typing import Protocol

import jax
import jax.numpy as jnp
import numpy as np
from mujoco.batch import Batch
from rich.console import Console
from rich.table import Table

from getup_jax.config import Config, TerrainConfig
from getup_jax.config.load import load_config
from getup_jax.envs.getup.observation import GRID_POINTS
from getup_jax.envs.getup.resets.rag_doll import DROPS, evenly, fall
from getup_jax.physics.character import CharacterSpec, load_character
from getup_jax.physics.settle import lift_to_ground, settle
from getup_jax.physics.terrain_map import REGIONS, TerrainMap, make_terrain
from support.command import command, duration, positive

STEPS = 10  # control steps of one round
TARGET_STD_RAD = 0.3
MIN_ROUNDS = 5
QUICK_SIMS = 8
LOOK_UPS = "look-ups"


class Timed(Protocol):
    """What is timed."""

    def round(self) -> float:
        """Seconds of STEPS control steps."""
        ...


def main() -> None:
    args = parse_args()
    config = load_config("terrain")
    assert config.terrain is not None
    ground = make_terrain(config.terrain)
    flat, uneven = load_character(config.physics), load_character(config.physics, ground)
    grounds = {"plane": Ground(flat, supine(flat, args.sims), config)}
    for region, qpos in lying(uneven, ground, args.sims).items():
        grounds[region] = Ground(uneven, qpos, config)
    seconds = measure({**grounds, LOOK_UPS: LookUps(ground, args.sims)}, args.seconds)
    looks = seconds.pop(LOOK_UPS)
    result = report(seconds, args.sims)
    result["look_ups_of_step"] = share_of_step(looks, seconds[REGIONS[0]])
    if args.drops:
        result["falls"] = time_falls(uneven, ground, args.drops, config.terrain)
    show(result)
    if args.json is not None:
        args.json.write_text(json.dumps(result, indent=2) + "\n")


def parse_args() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", type=Path, metavar="FILE")
    parser.add_argument("--sims", type=positive, default=256, metavar="N")
    parser.add_argument(
        "--seconds", type=duration, default=20.0, metavar="S", help="to measure for"
    )
    parser.add_argument("--drops", type=positive, metavar="N", help="rag-dolls (default: none)")
    parser.add_argument("--quick", action="store_true", help="8 simulations, the fewest rounds")
    args = parser.parse_args()
    if args.quick:
        args.sims, args.seconds = QUICK_SIMS, 0.0
    return args


class Ground:
    """A batch of lying characters on one ground."""

    def __init__(self, character: CharacterSpec, qpos: np.ndarray, config: Config):
        self._qpos, self._substeps = qpos, config.physics.substeps
        self._batch = Batch(character.model, len(qpos), persistent=True)
        rng = np.random.default_rng(0)
        noise = rng.normal(0.0, TARGET_STD_RAD, (STEPS, *qpos[:, 7:].shape))
        self._targets = qpos[:, 7:] + noise

    def round(self) -> float:
        """Seconds of STEPS control steps from the same start."""
        self._batch.reset()
        self._batch.qpos[:] = self._qpos
        begin = time.perf_counter()
        for target in self._targets:
            self._batch.ctrl[:] = target
            self._batch.step(nstep=self._substeps)
        return time.perf_counter() - begin


class LookUps:
    """What the task asks of a height field, for characters at random places."""

    def __init__(self, ground: TerrainMap, count: int):
        rng = np.random.default_rng(0)
        region = np.arange(count) % len(REGIONS)
        places = np.stack([ground.draw_spawn(int(r), 1, rng)[0] for r in region])
        near = rng.uniform(-0.5, 0.5, (count, GRID_POINTS**2, 2))
        self._field = jax.tree.map(jnp.asarray, ground.field())
        self._map = jnp.asarray(places[:, None] + near, jnp.float32)
        self._head = jnp.asarray(np.pad(places, ((0, 0), (0, 1)), constant_values=1.0), jnp.float32)
        self._look = jax.jit(lambda field, xy, head: (field.height(xy), field.clearance(head, 0.1)))

    def round(self) -> float:
        """Seconds of the look-ups of STEPS control steps."""
        begin = time.perf_counter()
        for _ in range(STEPS):
            jax.block_until_ready(self._look(self._field, self._map, self._head))
        return time.perf_counter() - begin


def supine(character: CharacterSpec, count: int) -> np.ndarray:
    """The neutral pose on its back, settled on the plane."""
    pose = character.neutral_qpos.copy()
    pose[3:7] = np.sqrt(0.5), 0.0, -np.sqrt(0.5), 0.0
    pose = lift_to_ground(character, pose[None], 0.01)
    return np.repeat(settle(character, pose, 0.5)[0], count, axis=0)


def lying(character: CharacterSpec, ground: TerrainMap, count: int) -> dict[str, np.ndarray]:
    """The same pose at random places of every region, settled there."""
    rng, field = np.random.default_rng(0), ground.field()
    plane = supine(load_character(Config().physics), count)
    result = {}
    for index, region in enumerate(REGIONS):
        qpos = plane.copy()
        qpos[:, :2] = ground.draw_spawn(index, count, rng)
        qpos[:, 2] += field.height(qpos[:, :2]) + 0.2 * index  # clear of the highest bump
        result[region] = settle(character, qpos, 2.0)[0]
    return result


def measure(parts: dict[str, Timed], seconds: float) -> dict[str, list[float]]:
    """Seconds of every round, the parts in turn."""
    for part in parts.values():
        part.round()
    times: dict[str, list[float]] = {name: [] for name in parts}
    begin = time.perf_counter()
    while time.perf_counter() - begin < seconds or len(times["plane"]) < MIN_ROUNDS:
        for name, part in parts.items():
            times[name].append(part.round())
    return times


def report(seconds: dict[str, list[float]], sims: int) -> dict:
    plane = seconds["plane"]
    grounds = {}
    for name, times in seconds.items():
        ratios = [p / t for p, t in zip(plane, times, strict=True)]
        grounds[name] = {
            "control_steps_per_s": sims * STEPS / statistics.median(times),
            "of_plane": statistics.median(ratios),
            "of_plane_low": min(ratios),
            "of_plane_high": max(ratios),
        }
    return {"sims": sims, "rounds": len(plane), "grounds": grounds}


def share_of_step(looks: list[float], steps: list[float]) -> dict[str, float]:
    """Seconds of the look-ups over those of the engine, round by round."""
    shares = [a / b for a, b in zip(looks, steps, strict=True)]
    return {"median": statistics.median(shares), "low": min(shares), "high": max(shares)}


def time_falls(
    character: CharacterSpec, ground: TerrainMap, count: int, config: TerrainConfig
) -> dict[str, float]:
    begin = time.perf_counter()
    rng = np.random.default_rng(config.seed)
    fall(character, ground, evenly(count), DROPS["limp"][0], rng, print)
    return {"drops": count, "seconds": time.perf_counter() - begin}


def show(result: dict) -> None:
    table = Table("ground", "control steps/s", "of the plane", "range")
    for name, row in result["grounds"].items():
        spread = f"{row['of_plane_low']:.2f} - {row['of_plane_high']:.2f}"
        table.add_row(name, f"{row['control_steps_per_s']:,.0f}", f"{row['of_plane']:.2f}", spread)
    Console().print(table)
    print(
        "look-ups: {median:.1%} of a control step of the engine in the flat region, {low:.1%} to "
        "{high:.1%}".format(**result["look_ups_of_step"])
    )
    if "falls" in result:
        print("{drops:.0f} rag-dolls at rest in {seconds:.0f} s".format(**result["falls"]))


if __name__ == "__main__":
    command(main)
