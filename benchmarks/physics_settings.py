"""How quiet, stable and fast the physics is under different settings of the servo and the solver.

    python benchmarks/physics_settings.py [--json FILE] [--quick]

Three trials a setting, all without learning:
  hold   the neutral pose as target for 4 s: norm of the 57 link angular velocities after 1 s
         (mean, rad/s), root height at the end (m)
  track  every authored motion as open-loop target: mean |hinge acceleration| (rad/s^2)
  speed  256 simulations lying with random filtered targets: control steps/s, interleaved over
         the settings, median of the rounds
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import statistics
import time
from pathlib import Path

import mujoco
import numpy as np
from mujoco.batch import Batch
from rich.console import Console
from rich.table import Table

from getup_jax.config import PhysicsConfig
from getup_jax.motion.authoring.keyframes import load_authored
from getup_jax.physics.character import CharacterSpec, load_character
from support.command import command, positive

BASE = PhysicsConfig(
    substeps=2, solver="pgs", iterations=10, gain_scale=1.5, armature=0.1, damping=1.0
)
SETTINGS = {
    "60 Hz, 1.5x, .1, PGS": {},
    "60 Hz, 1.5x, .1, Newton": {"solver": "newton", "iterations": 5},
    "60 Hz, 1.5x, .1, PGS, damping 0": {"damping": 0.0},
    "60 Hz, 1.5x, .1, PGS, damping 3": {"damping": 3.0},
    "60 Hz, 1.5x, .05, PGS": {"armature": 0.05},
    "60 Hz, 1x, .1, PGS": {"gain_scale": 1.0},
    "60 Hz, 2x, .1, PGS": {"gain_scale": 2.0},
    "60 Hz, 2x, .1, PGS, damping 0": {"gain_scale": 2.0, "damping": 0.0},
    "60 Hz, 5x, .1, PGS": {"gain_scale": 5.0},
    "90 Hz, 2x, .1, PGS": {"substeps": 3, "gain_scale": 2.0},
    "90 Hz, 1x, .05, PGS": {"substeps": 3, "gain_scale": 1.0, "armature": 0.05},
    "120 Hz, 1x, .05, Newton": {
        "substeps": 4, "gain_scale": 1.0, "armature": 0.05, "solver": "newton", "iterations": 5,
    },
    "120 Hz, 2x, .1, PGS": {"substeps": 4, "gain_scale": 2.0},
}  # fmt: skip
SIMS, PERIODS = 256, 20


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path)
    parser.add_argument("--quick", action="store_true", help="two settings, one round")
    parser.add_argument(
        "--rounds", type=positive, default=3, help="of the speed trial (default: 3)"
    )
    args = parser.parse_args()
    names = list(SETTINGS)[:2] if args.quick else list(SETTINGS)
    configs = {name: dataclasses.replace(BASE, **SETTINGS[name]) for name in names}
    characters = {name: load_character(config) for name, config in configs.items()}
    rows = {
        name: hold(characters[name], configs[name].substeps)
        | track(characters[name], configs[name].substeps)
        for name in names
    }
    for _ in range(1 if args.quick else args.rounds):
        for name in names:
            rate = speed(characters[name], configs[name].substeps)
            rows[name].setdefault("rates", []).append(rate)
    for row in rows.values():
        row["steps_per_s"] = statistics.median(row["rates"])
    show(rows)
    if args.json:
        args.json.write_text(json.dumps(rows, indent=2) + "\n")


def hold(character: CharacterSpec, substeps: int) -> dict:
    data = mujoco.MjData(character.model)
    data.qpos[:] = character.neutral_qpos
    norms = []
    for _ in range(120):
        advance(character.model, data, character.neutral_qpos[7:], substeps)
        norms.append(np.linalg.norm(link_angular_velocity(character.model, data)))
    return {"hold_rad_s": float(np.mean(norms[30:])), "hold_height_m": float(data.qpos[2])}


def track(character: CharacterSpec, substeps: int) -> dict:
    model, accelerations = character.model, []
    for getup in load_authored(character):
        if getup.clip is None:
            continue
        data = mujoco.MjData(model)
        data.qpos[:] = getup.clip.qpos[0]
        for pose in getup.clip.qpos:
            data.ctrl[:] = pose[7:]
            for _ in range(substeps):
                before = data.qvel[6:].copy()
                mujoco.mj_step(model, data)
                change = np.abs(data.qvel[6:] - before).mean()
                accelerations.append(change / model.opt.timestep)
    return {"track_rad_s2": float(np.mean(accelerations))}


def speed(character: CharacterSpec, substeps: int) -> float:
    model, rng = character.model, np.random.default_rng(0)
    batch = Batch(model, SIMS, persistent=True)
    batch.qpos[:] = lying(character, rng)
    noise = rng.normal(0.0, 0.4, (2 * PERIODS, SIMS, model.nu))
    target = np.zeros((SIMS, model.nu))
    for period in range(2 * PERIODS):
        if period == PERIODS:  # the first half settles the contacts
            begin = time.perf_counter()
        target = 0.8 * target + 0.2 * noise[period]
        batch.ctrl[:] = np.clip(target, character.joint_lower, character.joint_upper)
        batch.step(nstep=substeps, stage=mujoco.mjtStage.mjSTAGE_VEL.value)
    return SIMS * PERIODS / (time.perf_counter() - begin)


def lying(character: CharacterSpec, rng: np.random.Generator) -> np.ndarray:
    qpos = np.tile(character.neutral_qpos, (SIMS, 1))
    pitch = np.pi / 2 * np.sign(rng.uniform(-1, 1, SIMS))
    qpos[:, 2] = 0.2
    qpos[:, 3], qpos[:, 5] = np.cos(pitch / 2), np.sin(pitch / 2)
    return qpos


def advance(model: mujoco.MjModel, data: mujoco.MjData, ctrl: np.ndarray, substeps: int) -> None:
    data.ctrl[:] = ctrl
    mujoco.mj_step(model, data, substeps)
    mujoco.mj_forward(model, data)


def link_angular_velocity(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """Of the links below the root [L - 1, 3], world frame (rad/s)."""
    return data.cvel[2:, :3]


def show(rows: dict[str, dict]) -> None:
    table = Table("setting", "hold rad/s", "height m", "track rad/s^2", "control steps/s", "range")
    for name, row in rows.items():
        table.add_row(
            name,
            f"{row['hold_rad_s']:.3f}",
            f"{row['hold_height_m']:.3f}",
            f"{row['track_rad_s2']:.1f}",
            f"{row['steps_per_s']:.0f}",
            f"{min(row['rates']):.0f}-{max(row['rates']):.0f}",
        )
    Console(width=110).print(table)


if __name__ == "__main__":
    command(main)
