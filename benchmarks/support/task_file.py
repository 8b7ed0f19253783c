"""What `NumpyGetUp` needs of a built task, in a folder: model.mjb and task.npz."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from getup_jax.config import Config, ConfigError
from getup_jax.core import mirror
from getup_jax.envs.getup.build import BuiltTask
from getup_jax.envs.getup.episode import LYING, STANDING
from getup_jax.physics.native import NativeEngine


def write_task(folder: Path, task: BuiltTask, config: Config) -> None:
    """The files; raises ConfigError for a task that has no form in NumPy."""
    env = task.environment
    if task.prior is None or env.terrain is not None:
        raise ConfigError("peers: expected a config with a pose prior and a flat plane")
    if not isinstance(env.engine, NativeEngine):
        raise ConfigError(f"peers: expected physics.engine=native, got {env.engine.name}")
    mujoco.mj_saveModel(env.engine.model, str(folder / "model.mjb"))
    values = {**_prior(task.prior), **_task(task, config), **_starts(task, config)}
    np.savez(folder / "task.npz", **{k: np.asarray(v) for k, v in values.items()})


def _prior(prior: Any) -> dict[str, Any]:
    decoder, statistics = prior.variables["params"]["decoder"], prior.variables["statistics"]
    layers = len(decoder) - 1
    found = {
        "layers": layers,
        "latent_mean": prior.latent_mean,
        "latent_std": prior.latent_std,
        "kernel_out": decoder["output"]["kernel"],
        "bias_out": decoder["output"]["bias"],
        **statistics,
    }
    for i in range(layers):
        found |= {f"{kind}_{i}": decoder[f"hidden_{i}"][kind] for kind in ("kernel", "bias")}
    if prior.mirrored:
        own = prior.variables["mirror"]
        found |= {"mirror_index": own["index"], "mirror_sign": own["sign"]}
        found["latent_sign"] = mirror.latent(prior.latent_size).sign
    return found


def _task(task: BuiltTask, config: Config) -> dict[str, Any]:
    env, world = task.environment, task.world
    link, centre, radius = env.character.head_sphere
    links = env.observer.links
    names = (
        *("filter", "offset_scale", "offset_limit_rad", "stand_time_s", "lookahead_s"),
        *("terminate_reward", "terminate_after_s", "head_clearance_m"),
    )
    return {name: getattr(config.task, name) for name in names} | {
        "control_dt": env.engine.control_dt,
        "substeps": config.physics.substeps,
        "feature_links": [links.neck, links.left_hip, links.right_hip],
        "head_link": link,
        "head_centre": centre,
        "head_radius": radius,
        "neutral": world.neutral_rotation,
        "target_lower": world.target_lower,
        "target_upper": world.target_upper,
    }


def _starts(task: BuiltTask, config: Config) -> dict[str, Any]:
    """Lying and standing starts in the share that the config asks for, of all styles alike."""
    env, world = task.environment, task.world
    _, _, styles, rows = world.pool.table.shape
    share = config.task.stand_start
    standing = np.random.default_rng(config.seed).random(styles * rows) < share
    kind = jnp.asarray(np.where(standing, STANDING, LYING), jnp.int32)
    getup = jnp.arange(styles * rows) % styles
    row = jnp.arange(styles * rows) // styles
    state = jax.jit(env.start)(world, getup.astype(jnp.int32), kind, row.astype(jnp.int32))
    seen = state.physics.kinematics
    names = ("points", "duration", "time", "action")
    return {name: getattr(state, name) for name in names} | {"qpos": seen.qpos, "qvel": seen.qvel}
