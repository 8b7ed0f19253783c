"""What the page must know before the first motion: body, curves, starts, guides, ground."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from getup_jax.core.resources import asset_path
from getup_jax.editor.export import missing_extras
from getup_jax.editor.simulate import Simulator
from getup_jax.editor.starts import lies, reference_curve
from getup_jax.motion.clips import MotionError
from getup_jax.motion.getup.plot import strategy_curves
from getup_jax.motion.io import curve_file
from getup_jax.motion.io.curve_file import CurveFile, read_curve_file
from getup_jax.motion.library import AUTHORED
from getup_jax.physics.character import CharacterSpec
from getup_jax.physics.mirror_image import link_images
from getup_jax.physics.terrain import HeightField
from getup_jax.physics.terrain_map import REGIONS
from getup_jax.runtime.checkpoint import LoadedPolicy

_PATCH_M = 6.0  # the ground is sent this far to each side of the start
_SHAPES = {
    mujoco.mjtGeom.mjGEOM_SPHERE: "sphere",
    mujoco.mjtGeom.mjGEOM_CAPSULE: "capsule",
    mujoco.mjtGeom.mjGEOM_BOX: "box",
}


def describe(simulator: Simulator, loaded: LoadedPolicy) -> dict[str, Any]:
    """Plain values for JSON."""
    task, starts = simulator.task, simulator.starts
    bands = strategy_curves(task.getups, simulator.character)
    references = {getup.name: reference_curve(getup) for getup in task.getups}
    return {
        "policy": {"path": str(loaded.path), "steps": loaded.metadata.get("steps", 0)},
        "control_dt": simulator.control_dt,
        "stand_time_s": simulator.config.task.stand_time_s,
        "match_deg": float(np.degrees(simulator.config.task.curve_match_rad)),
        "limits": {"duration": curve_file.DURATION_S, "values": curve_file.LIMITS},
        "shapes": shapes(simulator.character),
        "links": simulator.character.link_names,
        "starts": [
            {
                "name": name,
                "lies": lies(clip, simulator.character),
                "first": references[name].values[0].tolist(),
            }
            for name, clip in starts.clips.items()
        ],
        "mirror": {
            "joint": simulator.character.mirror_joint.tolist(),
            "sign": simulator.character.mirror_sign.tolist(),
            "link": link_images(simulator.character).tolist(),
        },
        "mirrored": None if starts.places else curve_file.MIRRORED,
        "curves": [curve.plain() for curve in library_curves(simulator)],
        "bands": {
            name: {
                "mean": np.round(values.mean(axis=0), 4).tolist(),
                "deviation": np.round(values.std(axis=0), 4).tolist(),
                "count": len(values),
            }
            for name, values in bands.items()
        },
        "terrain": {"regions": REGIONS, "places": starts.places} if starts.places else None,
        "formats": missing_extras(),
    }


def library_curves(simulator: Simulator) -> list[CurveFile]:
    """The reference motions' curves, and the drawn ones if the policy trained on them."""
    found = [reference_curve(getup) for getup in simulator.task.getups]
    if AUTHORED not in simulator.config.motion.source:
        return found
    for file in sorted(asset_path("curves").glob("*.yaml")):
        curve = read_curve_file(file)
        try:
            curve.start_clip(simulator.starts.clips, simulator.character)
        except MotionError:
            continue  # a run on some of the motions lacks the others' starts
        found.append(curve)
    return found


def shapes(character: CharacterSpec) -> list[dict[str, Any]]:
    """Every visible shape of the body: link, kind, size, place in the link, colour."""
    model, found = character.model, []
    for geom in range(model.ngeom):
        kind = _SHAPES.get(mujoco.mjtGeom(model.geom_type[geom]))
        if kind is None or model.geom_bodyid[geom] == 0 or model.geom_group[geom] > 2:
            continue
        material = model.geom_matid[geom]
        colour = model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]
        found.append(
            {
                "link": int(model.geom_bodyid[geom]) - 1,
                "kind": kind,
                "size": model.geom_size[geom].tolist(),
                "position": model.geom_pos[geom].tolist(),
                "quaternion": model.geom_quat[geom].tolist(),
                "colour": colour[:3].tolist(),
            }
        )
    return found


def ground(simulator: Simulator, xy: np.ndarray) -> dict[str, Any] | None:
    """Heights of the ground around a place xy [2] (m) on its own grid; None on a flat plane."""
    field = simulator.task.world.terrain
    if not isinstance(field, HeightField):
        return None
    step, origin = float(field.step), np.asarray(field.origin)
    first = np.round((xy - _PATCH_M - origin) / step) * step + origin
    side = np.arange(round(2 * _PATCH_M / step) + 1) * step
    grid = np.stack(np.meshgrid(first[0] + side, first[1] + side), axis=-1)
    heights = np.asarray(field.height(grid.astype(np.float32)))
    return {
        "origin": first.tolist(),
        "step": step,
        "points": len(side),
        "heights": np.round(heights.ravel(), 4).tolist(),
    }
