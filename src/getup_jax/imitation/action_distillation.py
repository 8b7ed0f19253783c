"""Carries a trained policy over to other networks, another observation and another pose prior.

A policy acts by latent poses, and those of two priors have nothing to do with each other. What the
old policy means by an action is a servo target. The new prior has an action for it, too: the latent
that it encodes the old pose by, and offsets for what it cannot decode. So the old policy teaches a
new one to name its targets in the units of the new prior, from what the new one observes, such as
more of the curve than the old one knew of. It is policy distillation (Rusu et al. 2016) with DAgger
(Ross et al. 2011): in the first round the old policy acts, then the new one does, and the old one
says what it would have done there.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

from getup_jax.config import Config
from getup_jax.envs.getup.action_decoder import ActionDecoder
from getup_jax.envs.getup.observation import Observer
from getup_jax.envs.getup.symmetry import find_symmetry
from getup_jax.envs.getup.task import GetUpTask, World
from getup_jax.imitation import action_regression, demonstrations
from getup_jax.imitation.demonstrations import Demonstrations
from getup_jax.networks.equivariant import EquivariantMLP, dense
from getup_jax.pose_prior import prior as pose_prior
from getup_jax.pose_prior.prior import PosePrior
from getup_jax.rl import normalize
from getup_jax.rl.actor_critic import ActorCritic, make_actor_critic, normalized
from getup_jax.rl.learner import Learner
from getup_jax.rl.state import PolicyState
from getup_jax.runtime.checkpoint import LoadedPolicy
from getup_jax.runtime.pytree_store import CheckpointError, from_nested

_ROUNDS = 2
_SAMPLES = 100_000  # at least, of each round; those of its last rollout are held out


@dataclasses.dataclass(frozen=True, eq=False)
class Teacher:
    """A trained policy with what it was trained for."""

    model: ActorCritic
    policy: PolicyState
    decoder: ActionDecoder  # what its actions mean
    observer: Observer  # the layout of what it sees
    lookahead_s: tuple[float, ...]

    def act(self, observation: jax.Array) -> jax.Array:
        """Mean actions [N, A] of its own decoder, for raw observations [N, O] of its own layout."""
        return self.model.mean(self.policy.actor, normalized(self.policy, observation))

    def demonstrate(
        self, env: GetUpTask, decoder: ActionDecoder, observation: jax.Array
    ) -> Demonstrations:
        """What it would do, for raw observations [N, O] of a task, as an action of that task."""
        condition = env.observer.condition(observation)
        action = observation[..., env.observer.slices()["action"]]
        kept, places = _shared(self, env)
        block = self.observer.slices()["action"]
        seen = jnp.zeros((*observation.shape[:-1], self.observer.size))
        seen = seen.at[..., kept].set(observation[..., places])
        seen = seen.at[..., block].set(decoder.translate(action, condition, self.decoder))
        mean = self.act(seen)
        return Demonstrations(
            observation=observation,
            action=self.decoder.translate(mean, condition, decoder),
            target=self.decoder.target(mean, condition),
            condition=condition,
        )

    def policy_for(self, learner: Learner) -> PolicyState | None:
        """Its policy for the networks there, None where they need others.

        What an action means may still differ.
        """
        env, was, now = learner.env, self.model, learner.model
        if (
            self.lookahead_s != env.config.lookahead_s
            or self.observer.table != env.observer.table
            or (was.actor.hidden_sizes, was.actor.activation, was.initial_std is None)
            != (now.actor.hidden_sizes, now.actor.activation, now.initial_std is None)
        ):
            return None
        if (was.symmetry is None) == (now.symmetry is None):
            return self.policy
        is_even = all(size % 2 == 0 for size in was.actor.hidden_sizes)
        if not isinstance(was.actor, EquivariantMLP) or not is_even:
            return None
        return dataclasses.replace(self.policy, actor=dense(was.actor, self.policy.actor))


def make_teacher(
    config: Config,
    learner: Learner,
    world: World,
    loaded: LoadedPolicy,
    own: PolicyState,
    setting: str = "train.init_from",
) -> Teacher:
    """Of a loaded policy.

    Args:
        config: of the new run.
        learner: of the new run.
        world: of the new run.
        loaded: a checkpoint.
        own: the policy of the new run; with train.init_learner, it was loaded from there.
        setting: which one names the checkpoint.

    Raises CheckpointError where the run cannot begin with the policy.
    """
    env = learner.env
    assert isinstance(env, GetUpTask)
    prior = pose_prior.from_checkpoint(loaded.prior)
    observer = _observer(env, loaded.config, prior)
    symmetry = find_symmetry(env.character, observer, prior)
    _check(config, learner, world, loaded, prior, symmetry is not None, setting)
    latents = 0 if prior is None else prior.latent_size
    old = dataclasses.replace(env, observer=observer, symmetry=symmetry, latent_size=latents)
    model = make_actor_critic(old, loaded.config.network, config.ppo.normalize_observation)
    policy = own
    if not config.train.init_learner:
        key = jax.random.PRNGKey(0)
        template = jax.eval_shape(lambda key: model.init(key, config.ppo).policy, key)
        policy = from_nested(template, loaded.policy, str(loaded.path))
    neutral = env.decoder(world).neutral
    decoder = ActionDecoder(prior, loaded.config.task.offset_scale, neutral)
    return Teacher(model, policy, decoder, observer, loaded.config.task.lookahead_s)


def _observer(env: GetUpTask, loaded: Config, prior: PosePrior | None) -> Observer:
    """The layout of what the loaded policy sees."""
    latents = 0 if prior is None else prior.latent_size
    sizes = {
        "targets": 3 * len(loaded.task.lookahead_s),
        "action": latents + env.character.num_joints,
    }
    table = tuple((name, sizes.get(name, size)) for name, size in env.observer.table)
    return dataclasses.replace(env.observer, table=table)


def _check(
    config: Config,
    learner: Learner,
    world: World,
    loaded: LoadedPolicy,
    prior: PosePrior | None,
    was_mirrored: bool,
    setting: str,
) -> None:
    """Raise CheckpointError where the run cannot begin with the policy and its prior."""
    where = f"{setting}: {loaded.path}:"
    if (world.prior is None) != (prior is None):
        was, here = ("with", "has none") if world.prior is None else ("without", "has one")
        null = "leave out" if world.prior is None else "set"
        raise CheckpointError(
            f"{where} was trained {was} a pose prior, this run {here}; {null} prior: null, or "
            "start from another policy"
        )
    was_mirrored &= loaded.config.network.mirror
    if config.train.init_learner and was_mirrored != (learner.model.symmetry is not None):
        was = str(was_mirrored).lower()
        settings = f"network.mirror={was}"
        if prior is not None:
            settings += f" prior.mirror={str(prior.mirrored).lower()}"
        raise CheckpointError(
            f"{where} network.mirror is {was} there; expected the same here with "
            f"train.init_learner; set {settings}"
        )
    missing = set(loaded.config.task.lookahead_s) - set(config.task.lookahead_s)
    if missing:
        raise CheckpointError(
            f"{where} sees the curve {', '.join(f'{t:g}' for t in sorted(missing))} s ahead; "
            f"expected these among task.lookahead_s, got {list(config.task.lookahead_s)}; add them"
        )


def carry_over(
    learner: Learner,
    world: World,
    own: PolicyState,
    teacher: Teacher,
    key: jax.Array,
    log: Callable[[str], None],
) -> PolicyState:
    """The policy with which the run begins.

    Args:
        learner: of the new run.
        world: of the new run.
        own: the new run's fresh policy.
        teacher: the policy as it was trained.
        key: of the starts, the noise and the order of the minibatches.
        log: gets a line for each round.

    Returns the teacher's own policy where its weights mean the same here; networks that are not
    mirror-equivariant begin with weights that are, if the teacher's were.
    """
    env = learner.env
    assert isinstance(env, GetUpTask)
    decoder, begun = env.decoder(world), teacher.policy_for(learner)
    if begun is not None and teacher.decoder.same(decoder):
        return begun
    log("its networks, observation, prior or offsets are others: distilling it into this run's ...")
    demonstrate = functools.partial(teacher.demonstrate, env, decoder)
    policy, seen = own if begun is None else begun, []

    def act(observation: jax.Array) -> jax.Array:
        return demonstrate(observation).action

    rollouts = 1 + math.ceil(_SAMPLES / (learner.config.num_envs * learner.config.num_steps))
    for number, key_round in enumerate(jax.random.split(key, _ROUNDS)):
        key_roll, key_order = jax.random.split(key_round)
        part = demonstrations.collect(learner, env, world, act, demonstrate, rollouts, key_roll)
        training, heldout = demonstrations.split(part, len(part.observation) // rollouts)
        seen.append(training)
        if number == 0:
            statistics = _statistics(teacher, env, training.observation)
            policy = dataclasses.replace(policy, statistics=statistics)
            policy = learner.model.symmetric(policy)
        before, _ = action_regression.compare(learner, policy, decoder, heldout)
        policy = action_regression.clone(
            learner, policy, decoder, demonstrations.join(seen), key_order
        )
        after, offsets = action_regression.compare(learner, policy, decoder, heldout)
        log(
            f"round {number + 1} of {_ROUNDS}: its servo targets differ by {after:.2f} degrees "
            f"(rms) now, {before:.1f} before; offsets |dq|_1 {offsets:.1f} rad"
        )
        act = functools.partial(learner.act, policy)
    return policy


def _shared(teacher: Teacher, env: GetUpTask) -> tuple[np.ndarray, np.ndarray]:
    """The numbers of the teacher's observation that mean the same in the new one, and where there.

    All but the last action. Of the curve's points, those of the same time are the same.
    """
    old, new = teacher.observer.slices(), env.observer.slices()
    kept, places = [], []
    for name, size in teacher.observer.table:
        if name == "action":
            continue
        within = np.arange(size)
        kept.append(old[name].start + within)
        if name == "targets":
            rows = [env.config.lookahead_s.index(time) for time in teacher.lookahead_s]
            within = (3 * np.array(rows)[:, None] + np.arange(3)).reshape(-1)
        places.append(new[name].start + within)
    return np.concatenate(kept), np.concatenate(places)


def _statistics(
    teacher: Teacher, env: GetUpTask, observation: jax.Array
) -> normalize.Moments | None:
    """The teacher's statistics where it has them, else those of raw observations [N, O]."""
    old = teacher.policy.statistics
    if old is None:
        return None
    fresh = normalize.moments_of(observation, jnp.mean(observation, axis=0))
    kept, places = _shared(teacher, env)
    parts = {
        name: getattr(fresh, name).at[places].set(getattr(old, name)[kept])
        for name in ("mean", "residue", "variance")
    }
    return old.replace(**parts)
