"""Pytrees of arrays to orbax folders and back, as nested dicts of NumPy arrays.

Of an array that is spread over processes each writes what it has, so that all of them save
together; any number of processes reads it as a whole.

A nested dict needs no class to be read again, and NumPy arrays carry no device, so what
one machine writes another reads. Every leaf keeps its dtype, shape and bits.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import orbax.checkpoint as ocp

# Orbax stores no array of size zero: its shape and a one of its dtype stand for it.
_SHAPE, _ONE = "__shape__", "__one__"


class CheckpointError(ValueError):
    """A checkpoint is missing, damaged, of another format, or could not be written."""


def to_nested(tree: Any) -> dict[str, Any]:
    """The pytree as nested dicts of NumPy arrays; None stays, typed keys become raw.

    The names are those of `flax.serialization.to_state_dict`. The root is a container.
    """
    nested: dict[str, Any] = {}
    leaves, _ = jax.tree_util.tree_flatten_with_path(tree, is_leaf=lambda leaf: leaf is None)
    for path, leaf in leaves:
        *parents, name = _names(path)
        at = nested
        for parent in parents:
            at = at.setdefault(parent, {})
        at[name] = None if leaf is None else _to_numpy(leaf)
    return nested


def from_nested(template: Any, nested: dict[str, Any], where: str) -> Any:
    """The nested arrays in the template's structure, as new device arrays.

    Raises CheckpointError naming `where` and the array if one is missing, is of another
    shape or dtype, or has no place in the template.
    """
    leaves, treedef = jax.tree_util.tree_flatten_with_path(template)
    found = _flatten(nested)
    values = []
    for path, leaf in leaves:
        name = "/".join(_names(path))
        if name not in found:
            raise _mismatch(where, name, "is not in the checkpoint")
        values.append(_like(leaf, found.pop(name), where, name))
    if found:
        raise _mismatch(where, next(iter(found)), "has no place in this network")
    return jax.tree_util.tree_unflatten(treedef, values)


def write_item(folder: Path, nested: dict[str, Any]) -> None:
    """Write nested arrays into a new folder; returns when they are written.

    Where a run has many processes, all of them call it.
    """
    with ocp.Checkpointer(ocp.PyTreeCheckpointHandler()) as checkpointer:
        checkpointer.save(folder.absolute(), args=ocp.args.PyTreeSave(_map(_pack, nested)))
    # It holds nothing but this machine's path, and is not read.
    (folder / "commit_success.txt").unlink(missing_ok=True)


def read_item(folder: Path) -> dict[str, Any]:
    """The nested NumPy arrays that `write_item` wrote, whatever their shapes."""
    me = jax.process_index()
    alone = ocp.options.MultiprocessingOptions(primary_host=me, active_processes={me})
    handler = ocp.PyTreeCheckpointHandler(multiprocessing_options=alone)
    with ocp.Checkpointer(handler, multiprocessing_options=alone) as checkpointer:
        return _unpack(_restore(checkpointer, folder.absolute()))


def _restore(checkpointer: ocp.Checkpointer, folder: Path) -> Any:
    """The item as NumPy arrays, on however many devices it was written."""
    metadata: Any = checkpointer.metadata(folder)
    tree = metadata.item_metadata.tree
    plain = jax.tree.map(lambda _: ocp.RestoreArgs(restore_type=np.ndarray), tree)
    return checkpointer.restore(folder, args=ocp.args.PyTreeRestore(restore_args=plain))


def is_finite(nested: dict[str, Any]) -> bool:
    """Whether no floating-point array holds a NaN or an infinity."""
    floats = (a for a in _flatten(nested).values() if jnp.issubdtype(a.dtype, jnp.floating))
    return all(bool(np.isfinite(array.astype(np.float32)).all()) for array in floats)


def _names(path: tuple[Any, ...]) -> list[str]:
    return [jax.tree_util.keystr((part,), simple=True) for part in path]


def _is_key(leaf: Any) -> bool:
    return isinstance(leaf, jax.Array) and jnp.issubdtype(leaf.dtype, jax.dtypes.prng_key)


def _to_numpy(leaf: Any) -> Any:
    """The leaf as a NumPy array; one of which other processes have parts stays as it is."""
    if isinstance(leaf, jax.Array) and not (leaf.is_fully_addressable or leaf.is_fully_replicated):
        return leaf
    return np.asarray(jax.random.key_data(leaf) if _is_key(leaf) else leaf)


def _like(template: Any, array: np.ndarray, where: str, name: str) -> Any:
    """The array as the kind of leaf that the template is."""
    expected = jax.random.key_data(template) if _is_key(template) else template
    expected = expected if hasattr(expected, "dtype") else np.asarray(expected)
    if (array.shape, array.dtype) != (expected.shape, expected.dtype):
        raise _mismatch(where, name, f"is {_spec(array)}, expected {_spec(expected)}")
    if isinstance(template, bool | int | float):
        return type(template)(array.item())
    if isinstance(template, np.ndarray | np.generic):
        return array.copy()
    # A copy, since a training step gives the buffers of its state away.
    new = jnp.array(array)
    return (
        jax.random.wrap_key_data(new, impl=jax.random.key_impl(template))
        if _is_key(template)
        else new
    )


def _spec(array: Any) -> str:
    return f"{array.dtype}[{', '.join(map(str, array.shape))}]"


def _mismatch(where: str, name: str, problem: str) -> CheckpointError:
    hint = "use the settings in the checkpoint's config.yaml"
    return CheckpointError(f"{where}: the array {name} {problem}; {hint}")


def _flatten(nested: dict[str, Any], prefix: str = "") -> dict[str, np.ndarray]:
    """{"a": {"b": x}} as {"a/b": x}, without the Nones."""
    flat = {}
    for name, value in nested.items():
        if isinstance(value, dict):
            flat |= _flatten(value, f"{prefix}{name}/")
        elif value is not None:
            flat[prefix + name] = value
    return flat


def _map(function: Any, nested: Any) -> Any:
    if isinstance(nested, dict):
        return {name: _map(function, value) for name, value in nested.items()}
    return None if nested is None else function(nested)


def _pack(array: np.ndarray) -> Any:
    if array.size:
        return array
    return {_SHAPE: np.asarray(array.shape), _ONE: np.ones(1, array.dtype)}


def _unpack(nested: Any) -> Any:
    if not isinstance(nested, dict):
        return nested
    if nested.keys() == {_SHAPE, _ONE}:
        return np.zeros(tuple(nested[_SHAPE]), nested[_ONE].dtype)
    return {name: _unpack(value) for name, value in nested.items()}
