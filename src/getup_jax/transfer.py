"""Carries a trained policy over to another pose prior, so that other motions need no fresh start.

A policy acts by latent poses, and those of two priors have nothing to do with each other. What the
old policy means by an action is a servo target. The new prior has an action for it, too: the latent
that it encodes the old pose by, and offsets for what it cannot decode. So the old policy is run on
the new task under the old prior, and its actor is trained, by regression, to name its targets in
the units of the new one. A policy whose networks are averaged over mirror images (network.mirror)
and one whose are not are taught from each other in the same way.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import jax
import jax.numpy as jnp

from getup_jax import lessons
from getup_jax.algo import normalize
from getup_jax.algo.learner import Learner
from getup_jax.algo.state import PolicyState
from getup_jax.checkpoint import LoadedPolicy
from getup_jax.config import TaskConfig
from getup_jax.lessons import Lesson
from getup_jax.mirror import Symmetry
from getup_jax.nets import prior as pose_prior
from getup_jax.nets.prior import PosePrior
from getup_jax.storage import CheckpointError
from getup_jax.tasks.actions import Units
from getup_jax.tasks.getup import GetUpTask, World
from getup_jax.tasks.symmetry import find_symmetry

_ROLLOUTS = 24  # the last one is held out


@dataclasses.dataclass(frozen=True, eq=False)
class Origin:
    """Where a policy comes from: what its actions mean, and how its networks are evaluated."""

    task: TaskConfig
    prior: PosePrior | None
    symmetry: Symmetry | None = None  # None: not averaged over mirror images

    def mirrored_as(self, learner: Learner) -> bool:
        """Whether both networks are averaged over mirror images, or neither."""
        return (self.symmetry is None) == (learner.model.symmetry is None)


def origin(learner: Learner, world: World, loaded: LoadedPolicy, whole: bool) -> Origin:
    """Of a loaded policy, with its critic and its optimiser too if `whole`.

    Raises CheckpointError where the run of `learner` and `world` cannot begin with it.
    """
    env, where = learner.env, f"train.init_from: {loaded.path}:"
    assert isinstance(env, GetUpTask)
    if world.prior is not None and loaded.prior is None:
        raise CheckpointError(
            f"{where} was trained without a pose prior, this run has one; set prior: null, or "
            "start from another policy"
        )
    prior = None if loaded.prior is None else pose_prior.from_dict(loaded.prior)
    symmetry = None
    if loaded.config.network.mirror:
        symmetry = find_symmetry(loaded.config, env.character, env.observer, prior)
    found = Origin(loaded.config.task, prior, symmetry)
    if found.mirrored_as(learner) or not (whole or world.prior is None):
        return found
    was = str(symmetry is not None).lower()
    settings = f"network.mirror={was}"
    if prior is not None:
        settings += f" prior.mirror={str(prior.mirrored).lower()}"
    raise CheckpointError(
        f"{where} network.mirror is {was} there; expected the same here "
        f"{'with train.init_learner' if whole else 'without a pose prior'}; set {settings}"
    )


def carry_over(
    learner: Learner,
    world: World,
    policy: PolicyState,
    origin: Origin,
    key: jax.Array,
    log: Callable[[str], None],
) -> PolicyState:
    """The policy with an actor for the prior, the offsets and the mirror image of the new task.

    Args:
        learner: of the new task.
        world: of the new task.
        policy: as it was trained.
        origin: what it was trained on.
        key: of the starts, the noise and the order of the minibatches.
        log: gets a line before and after.

    Returns the same policy where an action means the same under both.
    """
    env = learner.env
    assert isinstance(env, GetUpTask)
    assert world.prior is not None
    old = Units(origin.prior, origin.task.offset_scale)
    new = Units(world.prior, env.config.offset_scale)
    if old.same(new) and origin.mirrored_as(learner):
        return policy
    log("its prior, offsets or mirror images are others: teaching the actor those of this run ...")
    key_roll, key_order = jax.random.split(key)
    teacher = dataclasses.replace(
        learner, model=dataclasses.replace(learner.model, symmetry=origin.symmetry)
    )
    seen = _lessons(teacher, env, world, policy, (old, new), key_roll)
    training, heldout = lessons.held_out(seen, len(seen.observation) // _ROLLOUTS)
    block = env.observer.slices()["action"]
    policy = dataclasses.replace(
        policy, statistics=_restated(policy.statistics, seen.observation, block)
    )
    policy = learner.model.symmetric(policy)
    before, _ = lessons.compare(learner, policy, new, heldout)
    policy = lessons.taught(learner, policy, new, training, key_order)
    after, offsets = lessons.compare(learner, policy, new, heldout)
    log(
        f"its servo targets differ by {after:.2f} degrees (rms) now, {before:.1f} before; "
        f"offsets |dq|_1 {offsets:.1f} rad"
    )
    return policy


def _lessons(
    learner: Learner,
    env: GetUpTask,
    world: World,
    policy: PolicyState,
    units: tuple[Units, Units],
    key: jax.Array,
) -> Lesson:
    """What the old policy does on the new task."""
    (old, new), block = units, env.observer.slices()["action"]
    config = dataclasses.replace(env.config, offset_scale=old.offset_scale, paths=None)
    env = dataclasses.replace(env, config=config)
    world = world.replace(prior=old.prior, pool=world.pool.replace(action=None))

    def lesson(observation: jax.Array) -> Lesson:
        condition = env.observer.condition(observation)
        mean = learner.act(policy, observation)
        seen = old.translate(observation[..., block], condition, new)
        return Lesson(
            observation=observation.at[..., block].set(seen),
            action=old.translate(mean, condition, new),
            target=old.target(mean, condition),
            condition=condition,
        )

    return lessons.watched(learner, env, world, policy, lesson, _ROLLOUTS, key)


def _restated(
    statistics: normalize.Moments | None, observation: jax.Array, block: slice
) -> normalize.Moments | None:
    """The statistics, those of the observation's action [N, O] in the new units."""
    if statistics is None:
        return None
    fresh = normalize.moments_of(observation, jnp.mean(observation, axis=0))
    return statistics.replace(
        **{
            name: getattr(statistics, name).at[block].set(getattr(fresh, name)[block])
            for name in ("mean", "residue", "variance")
        }
    )
