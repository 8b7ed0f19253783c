"""Motions as GLB files (binary glTF 2.0), which Blender, browsers and game engines read.

A node a link, named and jointed as in the character, each with the meshes of its shapes; every
motion is an animation of its own. Below a node that turns Z up into glTF's Y up, all is in the
character's own frames: metres, the root's translation, and rotations.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from getup_jax.core.output_file import write_bytes
from getup_jax.motion.io.geom_meshes import link_meshes
from getup_jax.motion.io.takes import Take, local_poses
from getup_jax.physics.character import CharacterSpec
from getup_jax.runtime.extras import load_extra

_UP = [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]  # x y z w: a quarter turn about x, from Z up to Y up
_FLOAT, _INT = 5126, 5125  # component types of glTF
_VERTICES, _INDICES = 34962, 34963  # buffer targets of glTF


def require_glb() -> Any:
    """The library that writes GLB, or ConfigError that says how to get it."""
    return load_extra("pygltflib", "glb", "--glb")


def write_glb(path: str | Path, character: CharacterSpec, takes: Sequence[Take]) -> None:
    """Write the character, and every take as an animation; see `glb_bytes`."""
    write_bytes(path, glb_bytes(character, takes))


def glb_bytes(character: CharacterSpec, takes: Sequence[Take]) -> bytes:
    """The content of a GLB file; without an animation the character stands in its neutral pose.

    Raises ConfigError where the extra `glb` is missing.
    """
    file = _File(require_glb())
    rest = local_poses(character, character.neutral_qpos[None])
    gl = file.gl
    meshes = link_meshes(character)
    for link, name in enumerate(character.link_names):
        position, rotation = rest[0][0, link], rest[1][0, link]
        node = gl.Node(name=name, translation=position.tolist(), rotation=rotation.tolist())
        if meshes[link]:
            node.mesh = file.mesh(name, meshes[link])
        file.document.nodes.append(node)
    parents = character.model.body_parentid[1:] - 1
    for link, node in enumerate(file.document.nodes):
        node.children = [int(child) for child in np.flatnonzero(parents == link)]
    file.document.nodes.append(gl.Node(name="character", rotation=_UP, children=[0]))
    file.document.scenes = [gl.Scene(nodes=[len(file.document.nodes) - 1])]
    file.document.scene = 0
    for take in takes:
        file.animation(take, *local_poses(character, take.qpos))
    return file.content()


class _File:
    """A glTF document and the bytes that it points to."""

    def __init__(self, gl: Any) -> None:
        self.gl = gl
        self.document = gl.GLTF2(asset=gl.Asset(version="2.0", generator="getup_jax"))
        self._blob = bytearray()
        self._materials: dict[tuple[float, ...], int] = {}

    def mesh(self, name: str, parts: Sequence[Any]) -> int:
        """A mesh of several shapes; gives its number."""
        gl, primitives = self.gl, []
        for part in parts:
            where = gl.Attributes(
                POSITION=self._add(part.vertices, "VEC3", _VERTICES, bounds=True),
                NORMAL=self._add(part.normals, "VEC3", _VERTICES),
            )
            indices = self._add(part.faces.reshape(-1, 1), "SCALAR", _INDICES)
            material = self._material(part.rgba)
            primitives.append(gl.Primitive(attributes=where, indices=indices, material=material))
        self.document.meshes.append(gl.Mesh(name=name, primitives=primitives))
        return len(self.document.meshes) - 1

    def animation(self, take: Take, place: np.ndarray, rotation: np.ndarray) -> None:
        """The root's way and the rotation of every link over time."""
        gl = self.gl
        made = gl.Animation(name=take.name)
        time = np.arange(len(place))[:, None] / take.fps
        clock = self._add(time, "SCALAR", bounds=True)

        def channel(node: int, path: str, values: int) -> None:
            made.samplers.append(gl.AnimationSampler(input=clock, output=values))
            target = gl.AnimationChannelTarget(node=node, path=path)
            number = len(made.samplers) - 1
            made.channels.append(gl.AnimationChannel(sampler=number, target=target))

        channel(0, "translation", self._add(place[:, 0], "VEC3"))
        for link in range(rotation.shape[1]):
            channel(link, "rotation", self._add(rotation[:, link], "VEC4"))
        self.document.animations.append(made)

    def content(self) -> bytes:
        """The whole file."""
        self.document.buffers = [self.gl.Buffer(byteLength=len(self._blob))]
        self.document.set_binary_blob(bytes(self._blob))
        return b"".join(self.document.save_to_bytes())

    def _add(
        self, values: np.ndarray, kind: str, target: int | None = None, bounds: bool = False
    ) -> int:
        """An accessor of rows of numbers; gives its number."""
        gl, integer = self.gl, values.dtype.kind in "iu"
        rows = np.ascontiguousarray(values, np.uint32 if integer else np.float32)
        start = len(self._blob)
        self._blob += rows.tobytes()
        view = gl.BufferView(buffer=0, byteOffset=start, byteLength=rows.nbytes, target=target)
        self.document.bufferViews.append(view)
        accessor = gl.Accessor(
            bufferView=len(self.document.bufferViews) - 1,
            componentType=_INT if integer else _FLOAT,
            count=len(rows),
            type=kind,
        )
        if bounds:
            accessor.min, accessor.max = rows.min(axis=0).tolist(), rows.max(axis=0).tolist()
        self.document.accessors.append(accessor)
        return len(self.document.accessors) - 1

    def _material(self, rgba: tuple[float, ...]) -> int:
        if rgba not in self._materials:
            look = self.gl.PbrMetallicRoughness(
                baseColorFactor=list(rgba), metallicFactor=0.0, roughnessFactor=0.8
            )
            self.document.materials.append(self.gl.Material(pbrMetallicRoughness=look))
            self._materials[rgba] = len(self.document.materials) - 1
        return self._materials[rgba]
