"""Loads the chain of trained policies that `composite.meta` names."""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from getup_jax.config import CompositeConfig, Config, ConfigError
from getup_jax.envs.composite.build import (
    BuiltComposite,
    action_centre,
    action_scale,
    load_clips,
    start_states,
)
from getup_jax.envs.composite.goals.combine import make_goals
from getup_jax.envs.composite.groups import resolve_groups
from getup_jax.envs.composite.meta.meta_policy import Level, LevelArrays, MetaTask, MetaWorld
from getup_jax.envs.composite.meta.observation_substitution import Substitution, make_substitution
from getup_jax.envs.composite.task import CompositeTask
from getup_jax.physics.character import CharacterSpec
from getup_jax.rl.actor_critic import make_actor_critic
from getup_jax.rl.state import PolicyState
from getup_jax.runtime.checkpoint import LoadedPolicy, load_policy
from getup_jax.runtime.pytree_store import from_nested


def with_meta(config: Config, built: BuiltComposite) -> tuple[MetaTask, MetaWorld]:
    """The task with the chain of meta policies in front of it, and its world.

    Raises ConfigError where a policy is of another character, task or goal.
    """
    task = built.environment
    chain = _load_chain(config, task)
    levels, arrays = [], []
    ends = [*(_actions(loaded.config, task) for loaded in chain), _actions(config, task, built)]
    for index, loaded in enumerate(chain):
        level, policy = _level(loaded, task, has_meta=index > 0)
        (centre, scale), (next_centre, next_scale) = ends[index], ends[index + 1]
        ratio, shift = scale / next_scale, (centre - next_centre) / next_scale
        user = chain[index + 1].config if index + 1 < len(chain) else config
        ratio, shift = jnp.asarray(ratio, jnp.float32), jnp.asarray(shift, jnp.float32)
        levels.append(level)
        arrays.append(LevelArrays(policy, ratio, shift, _sees(loaded.config, user, task)))
    links = _differ(_composite(chain[-1].config), task.config, task.character)
    new = tuple(links[task.character.joint_link].tolist())
    env = MetaTask(task, tuple(levels), new=new)
    return env, MetaWorld(built.world, tuple(arrays))


def _sees(own: Config, user: Config, task: CompositeTask) -> Substitution | None:
    """How a policy sees the links that the one which uses it has taken from it."""
    if _composite(user).meta_sees != "own":
        return None
    composite, character = _composite(own), task.character
    clips = load_clips(composite, character)
    starts, _ = start_states(composite, character, clips, task.engine, own.task.pool_size)
    return make_substitution(starts.history, _differ(composite, _composite(user), character))


def _differ(one: CompositeConfig, two: CompositeConfig, character: CharacterSpec) -> np.ndarray:
    """Which links [L] are in groups with other clips."""
    known, wanted = _clips_of(one, character), _clips_of(two, character)
    return np.array([clips != other for clips, other in zip(wanted, known, strict=True)])


def _clips_of(composite: CompositeConfig, character: CharacterSpec) -> list[tuple[str, ...]]:
    """The names of the clips of every link's group; of two groups with one link the first is."""
    found: list[tuple[str, ...]] = [()] * len(character.link_names)
    for group in reversed(resolve_groups(composite, character)):
        for link in group.links:
            found[link] = composite.groups[group.name].clips
    return found


def _load_chain(config: Config, task: CompositeTask) -> list[LoadedPolicy]:
    """The meta policies, the deepest one first."""
    chain: list[LoadedPolicy] = []
    composite = config.composite
    while composite is not None and composite.meta is not None:
        path = composite.meta
        loaded = load_policy(path)
        if any(loaded.path == other.path for other in chain):
            raise ConfigError(f"composite.meta: {path}: the chain comes back to this policy")
        _check(loaded, config, task, path)
        chain.append(loaded)
        composite = loaded.config.composite
    return chain[::-1]


def _check(loaded: LoadedPolicy, config: Config, task: CompositeTask, path: str) -> None:
    composite, key = loaded.config.composite, f"composite.meta: {path}"
    if composite is None or not loaded.config.composite_motion:
        raise ConfigError(
            f"{key}: is a policy of the get-up task; expected one of composite motion"
        )
    found, expected = loaded.config.physics.character, config.physics.character
    if found != expected:
        raise ConfigError(
            f"{key}: was trained on the character {found}, expected {expected}; train one on it, "
            "or change physics.character"
        )
    missing = sorted(set(composite.goals) - set(task.goals.names))
    if missing:
        raise ConfigError(
            f"{key}: looks at the goals {', '.join(missing)}; expected only those of "
            f"composite.goals: {', '.join(task.goals.names) or 'none'}"
        )


def _level(loaded: LoadedPolicy, task: CompositeTask, has_meta: bool) -> tuple[Level, PolicyState]:
    composite = _composite(loaded.config)
    goals = make_goals(composite.goals, task.character, task.engine.control_dt)
    own = dataclasses.replace(
        task,
        config=composite,
        groups=resolve_groups(composite, task.character),
        goals=goals,
    )
    env: Any = MetaTask(own, ()) if has_meta else own
    model = make_actor_critic(env, loaded.config.network, loaded.config.ppo.normalize_observation)
    template = jax.eval_shape(
        lambda key: model.init(key, loaded.config.ppo).policy, jax.random.PRNGKey(0)
    )
    policy = from_nested(template, loaded.policy, str(loaded.path))
    gives = loaded.config.network.initial_std is not None
    noise = loaded.config.ppo.std_scale[-1] if gives else 0.0
    return Level(model, _columns(task, goals.names), noise), policy


def _columns(task: CompositeTask, names: tuple[str, ...]) -> tuple[int, ...]:
    """Where a policy with the goals of these names finds its observation in the task's."""
    frames = task.frames[0] * task.frames[1]
    sizes = [goal.observation_size for goal in task.goals.goals]
    first = dict(zip(task.goals.names, frames + np.cumsum([0, *sizes[:-1]]), strict=False))
    size = dict(zip(task.goals.names, sizes, strict=True))
    columns = list(range(frames))
    for name in names:
        columns += range(int(first[name]), int(first[name]) + size[name])
    return tuple(columns)


def _actions(
    config: Config, task: CompositeTask, built: BuiltComposite | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Hinge angles [A] of a policy's action 0, and rad [A] of its action 1."""
    composite, character = _composite(config), task.character
    clips = load_clips(composite, character) if built is None else built.clips
    centre = action_centre(composite, character, clips)
    return centre, action_scale(composite, character, clips)


def _composite(config: Config) -> CompositeConfig:
    assert config.composite is not None  # `_check` has seen to it
    return config.composite
