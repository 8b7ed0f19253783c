"""From a config to a task that is ready to train: motions, prior, start states."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from getup_jax.config import Config, ConfigError, MotionConfig, TerrainConfig
from getup_jax.core.resources import asset_path, cache_dir
from getup_jax.envs.getup import user_rewards
from getup_jax.envs.getup.curriculum.curriculum import Curriculum
from getup_jax.envs.getup.observation import Observer
from getup_jax.envs.getup.resets import archived_states
from getup_jax.envs.getup.resets.lying_bodies import LimpBodies
from getup_jax.envs.getup.resets.pool import FlatStarts, build_pool
from getup_jax.envs.getup.resets.region_pool import Site, build_region_pool
from getup_jax.envs.getup.rewards import RESERVED
from getup_jax.envs.getup.symmetry import find_symmetry
from getup_jax.envs.getup.task import GetUpTask, World
from getup_jax.motion.clips import GetUp
from getup_jax.motion.getup.getups import flat_time
from getup_jax.motion.library import load_motions
from getup_jax.physics.character import CharacterSpec, load_character
from getup_jax.physics.engine import make_engine
from getup_jax.physics.plane import Plane
from getup_jax.physics.terrain import Ground, Terrain
from getup_jax.physics.terrain_map import make_terrain
from getup_jax.pose_prior.cache import cached_prior
from getup_jax.pose_prior.data import PoseSet, make_pose_set
from getup_jax.pose_prior.prior import PosePrior

_FLAT_S = 1.0  # a curve that lies flat for longer is mostly a matter of where it was cut


@dataclasses.dataclass(frozen=True, eq=False)
class BuiltTask:
    """A task and what belongs to it."""

    environment: GetUpTask
    world: World
    prior: PosePrior | None  # None: switched off by `prior: null`
    getups: tuple[GetUp, ...]  # the styles, in the order of the world's axis G


def build_task(
    config: Config,
    log: Callable[[str], None],
    prior: PosePrior | None = None,
    choose: Callable[[tuple[GetUp, ...], CharacterSpec], tuple[GetUp, ...]] | None = None,
) -> BuiltTask:
    """Load the motions, train the pose prior (or take the given one) and make the start states.

    choose: makes the styles out of those of the library; None: all of these.
    """
    user_rewards.check(config.task.rewards, RESERVED)
    archived_states.check(config.training_aids.archive)
    character = load_character(config.physics)
    log(f"motions: {', '.join(config.motion.source)}")
    library = load_motions(config.motion, character)
    getups = tuple(library.getups)
    if not getups:
        raise ConfigError(f"motion.source: no get-ups found in {config.motion.source}")
    log(f"motions: {len(getups)} get-ups, {len(library.poses)} poses")
    if config.prior is None:
        log("no pose prior: the policy's actions are the servo targets")
    elif prior is None:
        poses = _pose_set(library.poses, config.motion, character)
        prior, _ = cached_prior(
            poses, config.prior, cache_dir() / "prior", log, shipped=asset_path("priors")
        )
    if choose is not None:
        getups = choose(getups, character)
        log(f"motions: {len(getups)} styles made of them")
    say_which_lie(getups, config, log)
    return assemble(config, character, getups, prior, log)


def _pose_set(poses: np.ndarray, motion: MotionConfig, character: CharacterSpec) -> PoseSet:
    """The prior's data, of which some is held out."""
    least = 4 if motion.mirror else 2
    if len(poses) < least:
        raise ConfigError(
            f"motion.augment_poses: expected at least {least} poses for the pose prior, with those "
            f"of motion.source, got {len(poses)}; raise it, add motions, or set prior: null"
        )
    return make_pose_set(poses, character, mirrored=motion.mirror)


def say_which_lie(getups: Sequence[GetUp], config: Config, log: Callable[[str], None]) -> None:
    """Warn of curves that lie on the floor for longer than the head may."""
    lying = {getup.name: flat_time(getup) for getup in getups}
    found = [f"{name} ({seconds:.1f} s)" for name, seconds in lying.items() if seconds > _FLAT_S]
    if found:
        most = config.task.terminate_after_s + config.training_aids.head_grace_s
        log(
            "warning: these curves lie flat, but a head that is on the floor for more than "
            f"{most:.1f} s ends the episode; begin "
            f"them later: {', '.join(found)}"
        )


def assemble(
    config: Config,
    character: CharacterSpec,
    getups: Sequence[GetUp],
    prior: PosePrior | None,
    log: Callable[[str], None],
) -> BuiltTask:
    """The task from its finished parts; `character` stands on a plane."""
    site = None if config.terrain is None else _site(config, config.terrain)
    on_ground = character if site is None else site.character
    task = make_task(config, character, on_ground, prior)
    engine, action_size = task.engine, task.action_size
    log(f"engine: {engine.name}")
    place = Plane() if site is None else site.ground
    limp = LimpBodies(on_ground, place, config.task, config.seed, log).on_the_flat()
    flat = FlatStarts(
        getups, character, config.task, config.training_aids, config.seed, action_size, limp
    )
    if site is None:
        terrain: Ground = Terrain.flat()
        pool = build_pool(flat, engine, log)
    else:
        terrain = jax.tree.map(jnp.asarray, site.ground.field())
        pool = build_region_pool(getups, flat, site, engine, config.task, log)
    points = jnp.asarray(np.stack([g.points for g in getups]), jnp.float32)
    log(f"start states: {len(pool.time)}")
    margin = config.task.target_margin_rad
    world = World(
        prior=prior,
        pool=pool,
        terrain=terrain,
        points=points,
        duration=jnp.asarray([g.duration for g in getups], jnp.float32),
        neutral_rotation=_neutral_rotation(character, task.observer),
        target_lower=jnp.asarray(character.joint_lower - margin, jnp.float32),
        target_upper=jnp.asarray(character.joint_upper + margin, jnp.float32),
    )
    return BuiltTask(environment=task, world=world, prior=prior, getups=tuple(getups))


def make_task(
    config: Config,
    character: CharacterSpec,
    on_ground: CharacterSpec,
    prior: PosePrior | None,
) -> GetUpTask:
    """The task without a world; `character` stands on a plane, `on_ground` where it is trained."""
    latent_size = 0 if prior is None else prior.latent_size
    observer = Observer.of(
        character,
        len(config.task.lookahead_s),
        latent_size + character.num_joints,
        1.0 if config.terrain is None else config.terrain.relief_gain,
    )
    engine = make_engine(on_ground, config.physics)
    return GetUpTask(
        engine=engine,
        character=on_ground,
        observer=observer,
        config=config.task,
        curriculum=Curriculum(
            config=config.training_aids,
            stand_start=config.task.stand_start,
            control_dt=engine.control_dt,
            most_lift=config.training_aids.assistive_wrench * on_ground.weight,
            curve_match_rad=config.task.curve_match_rad,
            terrain=config.terrain,
        ),
        latent_size=latent_size,
        symmetry=find_symmetry(character, observer, prior),
    )


def _site(config: Config, terrain: TerrainConfig) -> Site:
    ground = make_terrain(terrain)
    return Site(terrain, ground, load_character(config.physics, ground))


def _neutral_rotation(character: CharacterSpec, observer: Observer) -> jnp.ndarray:
    data = mujoco.MjData(character.model)
    data.qpos[:] = character.neutral_qpos
    mujoco.mj_kinematics(character.model, data)
    return jax.jit(observer.joint_rotation)(np.asarray(data.xquat[1:], np.float32))
