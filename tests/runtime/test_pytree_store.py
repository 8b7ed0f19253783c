from __future__ import annotations

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from flax import serialization

from checkpoint_samples import assert_same, make_policy, make_state
from getup_jax.runtime.pytree_store import (
    CheckpointError,
    from_nested,
    is_finite,
    read_item,
    to_nested,
    write_item,
)


def test_round_trip_of_every_kind_of_leaf(tmp_path):
    state = make_state(3)
    write_item(tmp_path / "item", to_nested(state))
    assert_same(from_nested(make_state(0), read_item(tmp_path / "item"), "item"), state)


def test_nested_dicts_are_those_of_flax():
    policy = make_policy(1)
    expected = serialization.to_state_dict(policy)
    assert jax.tree.structure(to_nested(policy)) == jax.tree.structure(expected)
    assert_same(serialization.from_state_dict(make_policy(2), expected), policy)


@pytest.mark.parametrize(
    "leaf",
    [np.array([np.nan, -0.0], np.float32), np.zeros((2, 0)), np.float16(2), True, 7, 2.5],
    ids=str,
)
def test_host_leaves_stay_what_they_are(tmp_path, leaf):
    write_item(tmp_path / "item", to_nested({"x": leaf}))
    (back,) = from_nested({"x": leaf}, read_item(tmp_path / "item"), "item").values()
    assert isinstance(back, type(leaf)) or isinstance(leaf, np.generic)
    assert np.asarray(back).tobytes() == np.asarray(leaf).tobytes()
    assert np.shape(back) == np.shape(leaf)


def test_bfloat16_and_shape_only_templates(tmp_path):
    tree = {"x": jnp.ones(3, jnp.bfloat16)}
    write_item(tmp_path / "item", to_nested(tree))
    template = jax.eval_shape(lambda: tree)
    assert_same(from_nested(template, read_item(tmp_path / "item"), "item"), tree)


def test_finite_looks_at_floats_only():
    assert is_finite({"a": {"b": np.arange(3)}, "c": None})
    assert not is_finite({"a": {"b": np.array([1.0, np.inf])}})


@pytest.mark.parametrize(
    ("template", "message"),
    [
        (make_state(0, width=9), r"kernel is float32\[5, 8\], expected float32\[5, 9\]"),
        (
            replace(make_state(0), rows=jnp.zeros((3, 7))),
            "rows is uint32.*expected float32",
        ),
        (
            replace(make_state(0), nothing=jnp.ones(2)),
            "state/nothing is not in the checkpoint",
        ),
        (
            replace(make_state(0), flags=None),
            "state/flags has no place in this network",
        ),
    ],
    ids=["shape", "dtype", "missing", "extra"],
)
def test_another_structure_is_an_error_that_names_the_array(template, message):
    with pytest.raises(CheckpointError, match=message) as caught:
        from_nested({"state": template}, to_nested({"state": make_state(1)}), "00000004/learner")
    assert str(caught.value).startswith("00000004/learner: the array ")
    assert "config.yaml" in str(caught.value)
