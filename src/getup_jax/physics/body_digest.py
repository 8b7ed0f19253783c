"""What a policy remembers of the body that it was trained on, and whether another one differs.

A checkpoint's metadata has one short digest for each of a few groups of the compiled model's
physical fields, so that a warning can say what is other. Names, files, colours, the ground, balls
and the studs under soles on irregular ground are no part of it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from getup_jax.physics.terrain_model import GROUND_ONLY

KEY = "body"  # of a checkpoint's metadata
# group -> fields of its bodies, geoms, hinges, degrees of freedom or servos
_GROUPS = {
    "lengths": ("body_parentid", "body_pos", "body_quat"),
    "masses": ("body_mass", "body_inertia", "body_ipos", "body_iquat"),
    "shapes": ("geom_bodyid", "geom_type", "geom_size", "geom_pos", "geom_quat", "geom_friction"),
    "joints": ("jnt_bodyid", "jnt_axis", "jnt_pos", "jnt_range", "jnt_stiffness"),
    "damping": ("dof_damping", "dof_armature", "dof_frictionloss"),
    "servos": ("actuator_trnid", "actuator_gainprm", "actuator_biasprm", "actuator_forcerange"),
}
_PLACES = ("body_pos", "body_quat")  # the root's are where it starts
_DIGITS = 7  # compared: two machines compile the same file to numbers that differ in the last
_DECIMALS = 9
_SHORT = 12  # hexadecimal digits kept


def body_digest(model: mujoco.MjModel) -> dict[str, str]:
    """{group: digest} of a compiled character."""
    return {group: _digest(model, fields) for group, fields in _GROUPS.items()}


def warn_if_other(
    path: Path,
    metadata: Mapping[str, Any],
    body: Mapping[str, str] | None,
    log: Callable[[str], None],
) -> None:
    """Log a line where the policy at `path` was trained on another body than `body`.

    Checkpoints that do not say, and tasks without a body, give none.
    """
    known = metadata.get(KEY)
    if not isinstance(known, Mapping) or body is None:
        return
    differ = [group for group in _GROUPS if known.get(group) != body.get(group)]
    if differ:
        log(
            f"warning: {path}: was trained on a body with other {', '.join(differ)}; it may do "
            "much worse on this one; compare physics.character and the physics settings, or "
            "train on from it with train.init_from"
        )


def _digest(model: mujoco.MjModel, fields: tuple[str, ...]) -> str:
    digest = hashlib.sha256()
    for name in fields:
        values = np.asarray(getattr(model, name), np.float64)[_own(model, name)]
        text = " ".join(f"{_rounded(value):.{_DIGITS}g}" for value in values.ravel().tolist())
        digest.update(f"{name} {values.shape}: {text}\n".encode())
    return digest.hexdigest()[:_SHORT]


def _rounded(value: float) -> float:
    return round(value, _DECIMALS) + 0.0  # no -0


def _own(model: mujoco.MjModel, name: str) -> np.ndarray | slice:
    """Which entries of a field are the body's own: not the world's, the root's or the ground's."""
    kind = name.partition("_")[0]
    if kind == "geom":
        of_body, touches = model.geom_bodyid > 0, model.geom_contype | model.geom_conaffinity
        studs = (model.geom_contype == GROUND_ONLY) & (model.geom_conaffinity == 0)
        return of_body & (touches != 0) & ~studs
    first = {"body": 1, "jnt": 1, "dof": 6}.get(kind, 0)
    return slice(2 if name in _PLACES else first, None)
