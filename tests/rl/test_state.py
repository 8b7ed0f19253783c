from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from getup_jax.config.composite import DiscriminatorConfig
from getup_jax.rl.discriminator import Discriminator
from getup_jax.rl.state import LearnerState, PolicyState, owned
from getup_jax.runtime.pytree_store import from_nested, to_nested


def test_owned_arrays_are_strong_and_separate():
    shared = jnp.arange(3.0)
    weak = jnp.asarray(1.0)
    assert weak.weak_type
    state = {"a": shared, "b": shared, "weak": weak, "key": jax.random.key(0), "off": None}
    found = owned(state)
    assert not any(x.weak_type for x in (found["a"], found["weak"]))
    pointers = {x.unsafe_buffer_pointer() for x in (shared, found["a"], found["b"])}
    assert len(pointers) == 3
    np.testing.assert_array_equal(found["b"], shared)
    assert found["key"] == state["key"]
    assert jax.tree.structure(found) == jax.tree.structure(state)


def _learner(seed: int) -> LearnerState:
    small = DiscriminatorConfig(gru_size=4, hidden_sizes=(4,), heads=2)
    judge = Discriminator(small).init(jax.random.key(seed), num_frames=3, size=5)
    weight = jnp.full(2, float(seed))
    return LearnerState(
        policy=PolicyState(weight, None),
        critic=weight,
        average=weight,
        actor_optimiser=weight,
        critic_optimiser=weight,
        popart=None,
        learning_rate_scale=jnp.ones(()),
        discriminators={"upper": judge},
    )


def test_a_policy_goes_on_with_its_critic_and_discriminators_but_not_their_optimisers():
    old, new = _learner(1), _learner(2)
    stored = to_nested(old.valuation)
    found = new.beginning_with(old.policy, from_nested(new.valuation, stored, "here"))
    np.testing.assert_array_equal(found.critic, old.critic)
    np.testing.assert_array_equal(found.critic_optimiser, new.critic_optimiser)
    judge, was = found.discriminators["upper"], old.discriminators["upper"]
    for a, b in zip(jax.tree.leaves(judge.variables), jax.tree.leaves(was.variables), strict=True):
        np.testing.assert_array_equal(a, b)
    fresh = new.discriminators["upper"].optimiser
    assert jax.tree.structure(judge.optimiser) == jax.tree.structure(fresh)
    assert not any(np.any(x) for x in jax.tree.leaves(judge.optimiser))


def test_a_critic_alone_leaves_the_discriminators_as_they_are():
    old, new = _learner(1), _learner(2)
    found = new.beginning_with(old.policy, dataclasses.replace(old.valuation, discriminators=None))
    np.testing.assert_array_equal(found.critic, old.critic)
    assert found.discriminators["upper"] is new.discriminators["upper"]
