"""The markers of goals in a MuJoCo scene that is about to be rendered."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from getup_jax.envs.composite.goals.goal import Marker


def add_markers(scene: mujoco.MjvScene, markers: Sequence[Marker]) -> None:
    """Append the markers to what a scene shows; those that it has no room for are left out."""
    for marker in markers[: scene.maxgeom - scene.ngeom]:
        geom = scene.geoms[scene.ngeom]
        kind = mujoco.mjtGeom.mjGEOM_SPHERE
        if marker.reach is not None:
            kind = mujoco.mjtGeom.mjGEOM_ARROW
        size, turn = np.full(3, marker.radius), np.eye(3).ravel()
        mujoco.mjv_initGeom(
            geom, kind, size, marker.position, turn, np.array(marker.rgba, np.float32)
        )
        if marker.reach is not None:
            end = marker.position + marker.reach
            mujoco.mjv_connector(geom, kind, marker.radius, marker.position, end)
        scene.ngeom += 1
