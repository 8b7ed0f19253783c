"""Motions as USD files, which Omniverse, Houdini, Maya and Blender read.

A transform a link, named and jointed as in the character, each with the meshes of its shapes; Z up,
metres. USD has one time line: the takes come one after the other on it, a second apart, and the
root layer's custom data say which frames are whose.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from getup_jax.core.output_file import replacing
from getup_jax.motion.io.geom_meshes import Part, link_meshes
from getup_jax.motion.io.takes import Take, local_poses
from getup_jax.physics.character import CharacterSpec
from getup_jax.runtime.extras import load_extra

SUFFIXES = (".usd", ".usda", ".usdc")  # usda: text
_ROOT = "/character"
_GAP_S = 1.0


def require_usd() -> Any:
    """The library that writes USD, or ConfigError that says how to get it."""
    return load_extra("pxr", "usd", "--usd")


def write_usd(path: str | Path, character: CharacterSpec, takes: Sequence[Take]) -> None:
    """Write the character and the takes; without one it stands in its neutral pose.

    The time line has the rate of the first take; others are stretched to it. Raises ConfigError
    where the extra `usd` is missing.
    """
    require_usd()
    from pxr import Usd, UsdGeom  # pyright: ignore[reportMissingImports]

    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    rate = takes[0].fps if takes else 30.0
    stage.SetTimeCodesPerSecond(rate)
    stage.SetFramesPerSecond(rate)
    links = _links(stage, character)
    stage.SetDefaultPrim(stage.GetPrimAtPath(_ROOT))
    _pose(links, *local_poses(character, character.neutral_qpos[None]), [Usd.TimeCode.Default()])
    first, ranges = 0.0, {}
    for take in takes:
        frames = first + np.arange(len(take.qpos)) * rate / take.fps
        times = [Usd.TimeCode(float(frame)) for frame in frames]
        _pose(links, *local_poses(character, take.qpos), times)
        ranges[_identifier(take.name)] = f"{frames[0]:g}-{frames[-1]:g}: {take.name}"
        first = float(np.ceil(frames[-1] + _GAP_S * rate))
        stage.SetEndTimeCode(float(frames[-1]))
    if takes:
        stage.SetStartTimeCode(0.0)
        layer = stage.GetRootLayer()
        layer.customLayerData = {"takes": ranges}
    with replacing(path) as part:
        stage.GetRootLayer().Export(str(part))


def _links(stage: Any, character: CharacterSpec) -> list[tuple[Any, Any]]:
    """The place and the rotation of every link, below each other as its bodies are."""
    from pxr import UsdGeom  # pyright: ignore[reportMissingImports]

    UsdGeom.Xform.Define(stage, _ROOT)
    meshes, paths, found = link_meshes(character), [], []
    parents = character.model.body_parentid[1:] - 1
    for link, name in enumerate(character.link_names):
        above = _ROOT if parents[link] < 0 else paths[parents[link]]
        paths.append(f"{above}/{_identifier(name)}")
        node = UsdGeom.Xform.Define(stage, paths[-1])
        found.append((node.AddTranslateOp(), node.AddOrientOp()))
        for number, part in enumerate(meshes[link]):
            _mesh(UsdGeom.Mesh.Define(stage, f"{paths[-1]}/shape_{number}"), part)
    return found


def _mesh(mesh: Any, part: Part) -> None:
    from pxr import UsdGeom, Vt  # pyright: ignore[reportMissingImports]

    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(part.vertices.astype(np.float32)))
    mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(part.normals.astype(np.float32)))
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    mesh.CreateFaceVertexCountsAttr([3] * len(part.faces))
    mesh.CreateFaceVertexIndicesAttr([int(i) for i in part.faces.ravel()])
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateDisplayColorAttr([tuple(float(x) for x in part.rgba[:3])])


def _pose(
    links: list[tuple[Any, Any]], place: np.ndarray, rotation: np.ndarray, times: list[Any]
) -> None:
    """Set places [F, L, 3] and rotations [F, L, 4] (x y z w) of all links at the times [F]."""
    from pxr import Gf  # pyright: ignore[reportMissingImports]

    for link, (translate, orient) in enumerate(links):
        moves = link == 0 or len(times) == 1  # a link stays where it is in its parent
        for frame, time in enumerate(times):
            if moves:
                translate.Set(Gf.Vec3d(*map(float, place[frame, link])), time)
            x, y, z, w = map(float, rotation[frame, link])
            orient.Set(Gf.Quatf(w, x, y, z), time)


def _identifier(name: str) -> str:
    """A name as USD allows it: letters, digits and _, no digit first."""
    plain = re.sub(r"\W", "_", name, flags=re.ASCII)
    return f"_{plain}" if plain[:1].isdigit() or not plain else plain
