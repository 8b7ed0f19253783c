from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from getup_jax.rl.state import owned


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
