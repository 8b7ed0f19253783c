"""The animation of a GLB file as positions, read with pygltflib."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation


def read_glb(content: bytes) -> Any:
    """The document; skips the test without the extra `glb`."""
    return pytest.importorskip("pygltflib").GLTF2.load_from_bytes(content)


def link_places(document: Any) -> dict[str, np.ndarray]:
    """Positions [F, 3] (m, Z up) of every moving node over its animation, by name.

    What stands above the first link is left out: it only turns Z into Y.
    """
    (animation,) = document.animations
    moved = {
        (channel.target.node, channel.target.path): _values(
            document, animation.samplers[channel.sampler].output
        )
        for channel in animation.channels
    }
    parent = {child: i for i, node in enumerate(document.nodes) for child in node.children or ()}
    frames = document.accessors[animation.samplers[0].input].count
    known: dict[int, tuple[np.ndarray, Rotation]] = {}

    def place(node: int) -> tuple[np.ndarray, Rotation]:
        if node not in known:
            moves = (node, "rotation") in moved
            base, above = place(parent[node]) if moves and node in parent else _still(frames)
            known[node] = (
                _still(frames)
                if not moves
                else (
                    base + above.apply(_own(document, moved, node, frames)),
                    above * Rotation.from_quat(moved[node, "rotation"]),
                )
            )
        return known[node]

    return {document.nodes[node].name: place(node)[0] for node, path in moved if path == "rotation"}


def _still(frames: int) -> tuple[np.ndarray, Rotation]:
    return np.zeros((frames, 3)), Rotation.identity(frames)


def _own(document: Any, moved: dict, node: int, frames: int) -> np.ndarray:
    rest = np.tile(document.nodes[node].translation or (0.0, 0.0, 0.0), (frames, 1))
    return moved.get((node, "translation"), rest)


def _values(document: Any, accessor: int) -> np.ndarray:
    """The numbers [F, 3 or 4] behind an accessor."""
    found = document.accessors[accessor]
    view, width = document.bufferViews[found.bufferView], {"VEC3": 3, "VEC4": 4}[found.type]
    rows = document.binary_blob()[view.byteOffset : view.byteOffset + view.byteLength]
    return np.frombuffer(rows, "<f4").reshape(-1, width)
