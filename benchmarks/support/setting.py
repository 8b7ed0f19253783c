"""The config that is timed, with the engine and the sizes that are asked for."""

from __future__ import annotations

import argparse
import dataclasses
import math
from collections.abc import Callable
from pathlib import Path

from getup_jax.config import Config, MotionConfig, PriorConfig
from getup_jax.config.load import load_config
from getup_jax.motion.library import AUTHORED, DEEPMIMIC

NUM_STEPS = 8  # short, so that many rounds fit; rates do not depend on it
LEAST_STARTS = 64
# of --quick: the least that still takes every step
QUICK_ENVS, QUICK_STEPS, QUICK_DROPS, QUICK_POSES = 8, 4, 300, 256

Log = Callable[[str], None]


def make_config(args: argparse.Namespace, log: Log) -> Config:
    """The config with the engine and the batch that the arguments ask for."""
    config = with_motions(load_config(args.config, args.settings), log)
    if args.engine is not None:
        solver = "auto" if args.engine.startswith("mjx") else config.physics.solver
        physics = dataclasses.replace(config.physics, engine=args.engine, solver=solver)
        config = dataclasses.replace(config, physics=physics)
    if args.quick:
        config = _quick(config)
    quick = (QUICK_ENVS, QUICK_STEPS) if args.quick else (config.ppo.num_envs, NUM_STEPS)
    return _with_batch(config, args.num_envs or quick[0], args.num_steps or quick[1])


def with_motions(config: Config, log: Log) -> Config:
    """The config; with the authored motions where recordings that it names are not here."""
    folders = [name for name in config.motion.source if name not in (AUTHORED, DEEPMIMIC)]
    missing = [name for name in folders if not Path(name).expanduser().exists()]
    if config.composite_motion or not missing:
        return config
    log(f"motion.source: no {', '.join(missing)} here; the authored motions stand in for it")
    prior = config.prior
    if prior is not None:  # the one that is shipped with these motions
        prior = PriorConfig(
            latent_size=prior.latent_size, hidden_sizes=prior.hidden_sizes, mirror=prior.mirror
        )
    return dataclasses.replace(config, motion=MotionConfig(), prior=prior)


def _quick(config: Config) -> Config:
    """Few rag-dolls, and a pose prior that is trained in a moment on few poses."""
    task = dataclasses.replace(config.task, limp_drops=QUICK_DROPS)
    motion = dataclasses.replace(config.motion, augment_poses=QUICK_POSES)
    prior, terrain = config.prior, config.terrain
    if prior is not None:
        prior = dataclasses.replace(prior, epochs=1, min_updates=1)
    if terrain is not None:
        terrain = dataclasses.replace(terrain, drops=QUICK_DROPS)
    return dataclasses.replace(config, task=task, motion=motion, prior=prior, terrain=terrain)


def _with_batch(config: Config, num_envs: int, num_steps: int) -> Config:
    """The config for so many simulations and control steps an iteration."""
    batch, composite = num_envs * num_steps, config.composite
    ppo = dataclasses.replace(
        config.ppo,
        num_envs=num_envs,
        num_steps=num_steps,
        minibatch_size=math.gcd(config.ppo.minibatch_size, batch),
    )
    if composite is not None:
        judge = composite.discriminator
        size = math.gcd(judge.minibatch_size, round(batch * judge.share))
        judge = dataclasses.replace(judge, minibatch_size=size)
        composite = dataclasses.replace(composite, discriminator=judge)
    starts = min(config.task.pool_size, max(num_envs, LEAST_STARTS))
    task = dataclasses.replace(config.task, pool_size=starts)
    return dataclasses.replace(config, ppo=ppo, task=task, composite=composite)
