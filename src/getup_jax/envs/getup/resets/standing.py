"""Standing starts on irregular ground: the neutral pose with the feet turned to the slope [P 5.2].

The trunk stays upright. Each sole is put on the plane through the ground under it, the pelvis
comes down until both legs reach, and the hinges of hip, knee and ankle follow. Runs on the host.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import mujoco
import numpy as np
from mujoco.batch import Batch, SimulationError

from getup_jax.config import ConfigError
from getup_jax.envs.getup.resets.lying import Starts
from getup_jax.physics.character import CharacterSpec
from getup_jax.physics.surface import TOUCH_M, link_gaps
from getup_jax.physics.terrain import HeightField
from getup_jax.physics.terrain_map import REGIONS, TerrainMap

SIDES = ("l", "r")
CONTACT_M = 0.01  # a sole touches within this gap
_ITERATIONS, _DAMPING = 12, 1e-4  # of the solver for the legs
_CHECK_S, _MOST_DROP_M = 1.0, 0.08  # under its servos, the pelvis sinks by less in this time
_ROUNDS = 10


@dataclasses.dataclass(frozen=True)
class _Leg:
    """Indices and sizes of one leg."""

    foot: int  # body
    thigh: int  # body
    dofs: np.ndarray  # [7] of hip, knee and ankle
    sole: np.ndarray  # [3] middle of the sole in the foot's frame (m)
    half: np.ndarray  # [2] half length and width of the sole (m)


def stand(
    character: CharacterSpec,
    ground: TerrainMap,
    count: int,
    seed: int,
    log: Callable[[str], None],
) -> Starts:
    """`count` standing poses at rest, equally many in every irregular region, any heading.

    character: with the ground in its model. A place where the legs do not reach, or where the
    pose does not hold itself under its servos, is given up for another.
    """
    rng = np.random.default_rng(seed)
    field, legs = ground.field(), [_leg(character, side) for side in SIDES]
    parts = []
    for region in range(1, len(REGIONS)):
        wanted, kept = -(-count // (len(REGIONS) - 1)), np.zeros((0, len(character.neutral_qpos)))
        for _ in range(_ROUNDS):
            if len(kept) >= wanted:
                break
            xy = ground.draw_spawn(region, int(1.2 * (wanted - len(kept))) + 4, rng)
            yaw = rng.uniform(-np.pi, np.pi, len(xy))
            poses = [_pose(character, field, legs, *place) for place in zip(xy, yaw, strict=True)]
            kept = np.concatenate([kept, _holding(character, field, np.stack(poses))])
        else:
            raise ConfigError(
                f"terrain: no standing starts in the region {REGIONS[region]!r}: the legs do not "
                "reach the ground; make terrain.slope_deg, rough_m or height_m smaller"
            )
        parts.append(kept[:wanted])
    qpos = np.concatenate(parts)
    log(f"standing starts: {len(qpos)} with the feet turned to the slope")
    region = np.repeat(np.arange(1, len(REGIONS)), [len(part) for part in parts])
    return Starts(qpos, np.zeros((len(qpos), character.model.nv)), region)


def soles_touch(character: CharacterSpec, field: HeightField, qpos: np.ndarray) -> np.ndarray:
    """Whether both soles of poses qpos [N, 7 + J] are within CONTACT_M of the ground, [N]."""
    feet = link_gaps(character, field, qpos)[:, [character.link(f"foot_{s}") for s in SIDES]]
    return np.asarray((np.abs(feet) < CONTACT_M).all(axis=1))


def _holding(character: CharacterSpec, field: HeightField, qpos: np.ndarray) -> np.ndarray:
    """Those of the poses [N, 7 + J] whose soles touch and that hold themselves."""
    qpos = qpos[np.isfinite(qpos).all(axis=1)]
    qpos = qpos[soles_touch(character, field, qpos)]
    batch = Batch(character.model, max(1, len(qpos)))
    if len(qpos):
        batch.qpos[:], batch.ctrl[:] = qpos, qpos[:, 7:]
        try:
            batch.step(nstep=round(_CHECK_S / character.model.opt.timestep))
        except SimulationError as error:
            batch.qpos[error.ids] = np.nan
    drop = qpos[:, 2] - batch.qpos[: len(qpos), 2]
    return qpos[np.abs(drop) < _MOST_DROP_M]  # NaN compares as False


def _pose(
    character: CharacterSpec, field: HeightField, legs: list[_Leg], xy: np.ndarray, yaw: float
) -> np.ndarray:
    """The standing pose [7 + J] at a place; NaN where the legs do not reach their soles."""
    model, data = character.model, mujoco.MjData(character.model)
    data.qpos[:] = character.neutral_qpos
    data.qpos[:2], data.qpos[3:7] = xy, [np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)]
    mujoco.mj_kinematics(model, data)
    targets = [_ankle_target(data, field, leg) for leg in legs]
    heights = []
    for leg, (ankle, _) in zip(legs, targets, strict=True):
        hip, foot = data.xpos[leg.thigh], data.xpos[leg.foot]
        reach = np.linalg.norm(hip - foot)
        level = np.linalg.norm(hip[:2] - ankle[:2])
        heights.append(ankle[2] + np.sqrt(max(reach**2 - level**2, 0.0)) - hip[2])
    data.qpos[2] += min(heights)
    for leg, (ankle, turn) in zip(legs, targets, strict=True):
        if not _solve(character, data, leg, ankle, turn):
            return np.full_like(data.qpos, np.nan)
    return data.qpos.copy()


def _ankle_target(
    data: mujoco.MjData, field: HeightField, leg: _Leg
) -> tuple[np.ndarray, np.ndarray]:
    """Where the ankle [3] goes and how the foot [3, 3] is turned, for a sole on the ground."""
    flat = data.xmat[leg.foot].reshape(3, 3)
    forward = np.array([flat[0, 0], flat[1, 0]]) / np.hypot(flat[0, 0], flat[1, 0])
    across = np.array([-forward[1], forward[0]])
    middle = (data.xpos[leg.foot] + flat @ leg.sole)[:2]
    u, v = (part.ravel() for part in np.meshgrid(*(h * np.linspace(-1, 1, 5) for h in leg.half)))
    height = field.height(middle + u[:, None] * forward + v[:, None] * across)
    basis = np.stack([np.ones_like(u), u, v], axis=1)
    level, along, aside = np.linalg.lstsq(basis, height, rcond=None)[0]
    bump = (height - basis @ [level, along, aside]).max()  # so that no corner starts below
    normal = np.append(-(along * forward + aside * across), 1.0)
    normal /= np.linalg.norm(normal)
    x = np.append(forward, along)
    x /= np.linalg.norm(x)
    turn = np.stack([x, np.cross(normal, x), normal], axis=1)
    sole = np.append(middle, level) + (bump - TOUCH_M) * normal
    return sole - turn @ leg.sole, turn


def _solve(
    character: CharacterSpec, data: mujoco.MjData, leg: _Leg, ankle: np.ndarray, turn: np.ndarray
) -> bool:
    """Turn the leg's hinges until its foot is there; whether it got there."""
    model, hinges = character.model, leg.dofs - 6
    jacobian, error = np.zeros((6, model.nv)), np.full(6, np.inf)
    for _ in range(_ITERATIONS):
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        error = np.concatenate([ankle - data.xpos[leg.foot], _turn_error(data, leg, turn)])
        if np.abs(error).max() < 1e-4:
            return True
        mujoco.mj_jacBody(model, data, jacobian[:3], jacobian[3:], leg.foot)
        own = jacobian[:, leg.dofs]
        step = own.T @ np.linalg.solve(own @ own.T + _DAMPING * np.eye(6), error)
        angles = data.qpos[leg.dofs + 1] + np.clip(step, -0.3, 0.3)
        lower, upper = character.joint_lower[hinges], character.joint_upper[hinges]
        data.qpos[leg.dofs + 1] = np.clip(angles, lower, upper)
    return bool(np.abs(error).max() < 2e-3)


def _turn_error(data: mujoco.MjData, leg: _Leg, turn: np.ndarray) -> np.ndarray:
    """Rotation vector [3] (rad, world) from the foot's rotation to the wanted one, if small."""
    now = data.xmat[leg.foot].reshape(3, 3)
    return 0.5 * np.cross(now.T, turn.T).sum(axis=0)


def _leg(character: CharacterSpec, side: str) -> _Leg:
    model = character.model
    foot = model.body(f"foot_{side}").id
    box = model.geom(f"foot_{side}")
    chain = [character.link(f"{part}_{side}") for part in ("thigh", "shin", "foot")]
    hinges = np.flatnonzero(np.isin(character.joint_link, chain))
    return _Leg(
        foot=foot,
        thigh=model.body(f"thigh_{side}").id,
        dofs=hinges + 6,
        sole=box.pos - [0.0, 0.0, box.size[2]],
        half=box.size[:2].copy(),
    )
