"""Arms in the nearer of the two hinge triples that give the same pose.

Three hinges about orthogonal axes that turn half a turn each have two triples for every pose:
(a, b, c) and (a + pi, pi - b, c + pi). A solver that follows a recording frame by frame may
leave the triple near rest as an arm swings overhead, and then never comes back, since the way
leads through the singularity at b = pi / 2. Here the whole clip is known: a Viterbi search
says in which triple each frame is best and where changing costs least, and every change is a
least-squares path of a few frames that keeps the direction of the limb as well as it can.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.optimize import least_squares

from getup_jax.physics.character import CharacterSpec

_FULL_TURN = 3.0  # rad; a triple has a twin in reach where every hinge turns this far both ways


@dataclasses.dataclass(frozen=True)
class BranchSettings:
    """When a limb changes its triple, and how."""

    change: float = 30.0  # cost of a change in frames times rad^2 away from rest
    far: float = (
        300.0  # added to it times cos(b)^2: changes away from the singularity turn the limb
    )
    half_s: float = 0.27  # a change takes this long before and after its frame
    speed: float = 12.0  # rad/s of every hinge in a change
    smooth: float = 0.1  # weight of the hinges' acceleration against the error of the direction


def nearer_branches(
    qpos: np.ndarray,
    character: CharacterSpec,
    fps: float,
    settings: BranchSettings = BranchSettings(),
) -> np.ndarray:
    """Poses [F, 7 + J] with the same limbs, each in the triple that is nearer to rest."""
    qpos = qpos.copy()
    for hinges, turns in _triples(character):
        columns = 7 + hinges
        triple = qpos[:, columns]
        twin = _twin(triple)
        chosen = _choose(triple, twin, settings)
        moved = np.where(chosen[:, None], twin, triple)
        half = max(4, round(settings.half_s * fps))
        for frame in (np.flatnonzero(np.diff(chosen.astype(np.int8))) + 1).tolist():
            start, stop = max(frame - half, 0), min(frame + half, len(moved) - 1)
            moved[start : stop + 1] = _path(moved, triple, (start, stop), turns, fps, settings)
        low, high = character.joint_lower[hinges], character.joint_upper[hinges]
        qpos[:, columns] = np.clip(moved, low, high)
    return qpos


def _triples(character: CharacterSpec) -> list[tuple[np.ndarray, np.ndarray]]:
    """(hinge indices [3], turns [3, 3, 3]) of the links with three free, orthogonal hinges.

    A turn is the matrix of the cross product with the hinge's axis.
    """
    model, found = character.model, []
    for body in range(1, model.nbody):
        first, count = model.body_jntadr[body], model.body_jntnum[body]
        if count != 3:
            continue
        hinges = np.arange(first, first + 3) - 1  # the root's free joint is joint 0
        axes = model.jnt_axis[first : first + 3]
        orthogonal = np.allclose(axes @ axes.T, np.eye(3), atol=1e-6)
        reach = np.minimum(character.joint_upper[hinges], -character.joint_lower[hinges])
        if orthogonal and (reach > _FULL_TURN).all():
            found.append((hinges, np.cross(np.eye(3), axes[:, None])))
    return found


def _twin(triple: np.ndarray) -> np.ndarray:
    """The other angles [F, 3] of the same rotations, within half a turn of 0."""
    a, b, c = triple.T
    other = np.stack([a + np.pi, np.pi - b, c + np.pi], axis=1)
    return (other + np.pi) % (2 * np.pi) - np.pi


def _choose(triple: np.ndarray, twin: np.ndarray, settings: BranchSettings) -> np.ndarray:
    """Mask [F] of the frames that are best in the twin: Viterbi over both branches."""
    stay = np.stack([np.square(angles).sum(axis=1) for angles in (triple, twin)], axis=1)
    change = settings.change + settings.far * np.square(np.cos(triple[:, 1]))
    cost, came_from = stay[0], np.zeros((len(triple), 2), np.int64)
    for frame in range(1, len(triple)):
        ways = cost[None] + change[frame] * (1 - np.eye(2))  # [to, from]
        came_from[frame] = ways.argmin(axis=1)
        cost = ways.min(axis=1) + stay[frame]
    chosen = np.empty(len(triple), bool)
    branch = int(cost.argmin())
    for frame in range(len(triple) - 1, -1, -1):
        chosen[frame] = branch
        branch = int(came_from[frame, branch])
    return chosen


def _path(
    moved: np.ndarray,
    triple: np.ndarray,
    window: tuple[int, int],
    turns: np.ndarray,
    fps: float,
    settings: BranchSettings,
) -> np.ndarray:
    """Angles [n, 3] from one end of the window to the other, with the limb turned as before."""
    start, stop = window
    ends = moved[[start, stop]]
    share = np.linspace(0, 1, stop - start + 1)[:, None]
    line = ends[0] + share * (ends[1] - ends[0])
    wanted = _rotation(triple[start : stop + 1], turns)
    reach = settings.speed / fps

    def residual(inner: np.ndarray) -> np.ndarray:
        path = np.concatenate([ends[:1], inner.reshape(-1, 3), ends[1:]])
        turned = np.sqrt(0.5) * (_rotation(path, turns) - wanted)  # its norm is 2 sin(angle / 2)
        step = np.diff(path, axis=0)
        too_fast = 20.0 * np.maximum(np.abs(step) - reach, 0.0)
        bend = settings.smooth * np.diff(step, axis=0)
        return np.concatenate([part.ravel() for part in (turned, too_fast, bend)])

    inner = least_squares(residual, line[1:-1].ravel(), max_nfev=40).x
    return np.concatenate([ends[:1], inner.reshape(-1, 3), ends[1:]])


def _rotation(angles: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """Rotation matrices [n, 3, 3] of hinges [n, 3] that turn one after the other."""
    sine, rest = np.sin(angles)[..., None, None], 1 - np.cos(angles)[..., None, None]
    matrix = np.eye(3) + sine * turns + rest * (turns @ turns)  # Rodrigues, [n, 3, 3, 3]
    return matrix[:, 0] @ matrix[:, 1] @ matrix[:, 2]
