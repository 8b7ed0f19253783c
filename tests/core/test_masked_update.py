from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from getup_jax.core.masked_update import replace_rows

N = 10


def doubled(rows):
    return lambda index: jax.tree.map(lambda x: 2.0 * x[index], rows)


@pytest.mark.parametrize("chunk", [1, 3, 10, 64])
@pytest.mark.parametrize("masked", [[], [0], [9], [1, 2, 7], list(range(N))])
def test_only_masked_rows_change(chunk, masked):
    rows = {"a": jnp.arange(N, dtype=jnp.float32), "b": jnp.ones((N, 2, 3))}
    mask = np.isin(np.arange(N), masked)
    changed = jax.jit(lambda rows, mask: replace_rows(rows, mask, doubled(rows), chunk))(
        rows, jnp.asarray(mask)
    )
    for name, value in rows.items():
        value = np.asarray(value)
        wide = mask.reshape(-1, *[1] * (value.ndim - 1))
        np.testing.assert_array_equal(changed[name], np.where(wide, 2.0 * value, value))


def test_no_more_chunks_are_computed_than_are_needed():
    calls = []

    def compute(index):
        jax.debug.callback(lambda i: calls.append(i.shape), index)
        return jnp.zeros(len(index))

    mask = jnp.arange(N) < 4
    result = replace_rows(jnp.ones(N), mask, compute, chunk=3)
    jax.block_until_ready(result)
    jax.effects_barrier()
    assert calls == [(3,), (3,)]
