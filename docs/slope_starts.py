"""Of which lying starts on irregular ground a policy gets up, alone and with the helping hand.

    python docs/slope_starts.py --ckpt terrain [--region hard] [--rows 14] [--hand 0.5 --until 1.5]

Every curve that can start in the region starts in as many rows; other rag-dolls than those of the
training. Prints the share of episodes without an early end by the class of misfit.py, which is how
far the neck is below the curve, in steps of 6 cm, and that of the curves on a side.
"""

from __future__ import annotations

import argparse
import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np

from getup_jax.config import Config, ConfigError
from getup_jax.envs.getup.build import BuiltTask, build_task
from getup_jax.envs.getup.episode import LYING
from getup_jax.envs.getup.resets import misfit
from getup_jax.evaluation.getup import evaluation_config, restore_policy
from getup_jax.evaluation.motion_quality import FootPoints
from getup_jax.evaluation.rollout import Roller
from getup_jax.evaluation.scenario import Scenario, orientation
from getup_jax.physics.terrain_map import REGIONS
from getup_jax.pose_prior import prior as pose_prior
from getup_jax.rl.learner import Learner
from getup_jax.rl.state import PolicyState
from getup_jax.runtime import checkpoint


def main() -> None:
    """Run the episodes and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--ckpt", default="terrain", help="policy, as in getup-eval")
    parser.add_argument("--region", choices=REGIONS[1:], default="hard")
    parser.add_argument("--rows", type=int, default=14, metavar="N", help="starts of every curve")
    parser.add_argument("--hand", type=float, default=0.0, metavar="SHARE", help="of the weight")
    parser.add_argument("--until", type=float, default=math.inf, metavar="S", help="it lets go")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    loaded = checkpoint.load_policy(args.ckpt)
    if loaded.config.terrain is None:
        raise ConfigError(f"--ckpt {args.ckpt}: was trained on a flat plane, which has no slopes")
    if args.rows < 1 or args.hand < 0 or args.until <= 0:
        raise ConfigError("--rows, --hand, --until: expected at least 1, at least 0, more than 0")
    prior = pose_prior.from_checkpoint(loaded.prior)
    config = _config(loaded.config, args)
    task = build_task(config, print, prior)
    startable, region = task.world.pool.startable, REGIONS.index(args.region)
    assert startable is not None  # of irregular ground
    styles = np.asarray(startable.styles)[region, : int(startable.count[region])]
    getup, row = np.repeat(styles, args.rows), np.tile(np.arange(args.rows), len(styles))
    learner, policy = restore_policy(loaded, task)
    lasted = _lasted(task, learner, policy, (getup, row, region), args.hand)
    _print(task, getup, row, region, lasted)


def _config(config: Config, args: argparse.Namespace) -> Config:
    """That of the evaluation, with the rows that are asked for and the hand's time."""
    asked = Scenario(episodes=len(REGIONS) * args.rows * 100, seed=args.seed)
    config = evaluation_config(config, asked)
    return dataclasses.replace(config, task=dataclasses.replace(config.task, assist_s=args.until))


def _lasted(
    task: BuiltTask,
    learner: Learner,
    policy: PolicyState,
    starts: tuple[np.ndarray, np.ndarray, int],
    share: float,
) -> np.ndarray:
    """Which episodes [N] have no early end; starts: style [N], row [N] and the region."""
    env, world = task.environment, task.world
    getup, row, region = starts
    roller = Roller(env, learner, LYING, FootPoints.of(env.character))
    ones, place = jnp.ones(len(getup)), jnp.full(len(getup), region, jnp.int32)
    carry = jax.jit(roller.start)(
        world, jnp.asarray(getup, jnp.int32), jnp.asarray(row, jnp.int32), ones, place
    )
    if share > 0:
        lift = share * env.character.weight * ones
        carry = carry.replace(state=carry.state.replace(lift=lift))
    advance = jax.jit(roller.advance)
    steps = np.zeros(len(getup), int)
    while np.asarray(carry.running).any():
        carry, trace = advance(world, policy, carry)
        steps += np.asarray(trace.running).sum(axis=0)
    full = (np.asarray(world.duration)[getup] + env.config.stand_time_s) / env.engine.control_dt
    return steps >= np.round(full)


def _print(
    task: BuiltTask, getup: np.ndarray, row: np.ndarray, region: int, lasted: np.ndarray
) -> None:
    world = task.world
    found = misfit.classes(world.pool, task.environment.observer, world.terrain, world.points)
    kind = np.asarray(found)[np.asarray(world.pool.table)[LYING, region, getup, row]]
    side = np.array([orientation(style) == "side" for style in task.getups])[getup]
    groups = {"all": np.ones(len(getup), bool), "on a side": side}
    groups |= {f"misfit {value}": kind == value for value in range(misfit.CLASSES)}
    for name, chosen in groups.items():
        if chosen.any():
            print(f"{name:10s} {lasted[chosen].mean():7.1%} of {chosen.sum()}")


if __name__ == "__main__":
    main()
