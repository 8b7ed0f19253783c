"""A character: its MJCF model, and every name in it resolved to an index once."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np

from getup_jax.config import ConfigError, PhysicsConfig
from getup_jax.config.check import did_you_mean
from getup_jax.core.resources import asset_path
from getup_jax.physics.character_map import SUFFIX, read_mapped
from getup_jax.physics.props import Equipment, add_balls, add_racket
from getup_jax.physics.requirements import check_character, hinges_of
from getup_jax.physics.terrain_map import TerrainMap
from getup_jax.physics.terrain_model import FLOOR, replace_floor

_REFUSALS = (ValueError, mujoco.FatalError)  # of files that MuJoCo does not take
SOLVERS = {
    "auto": mujoco.mjtSolver.mjSOL_PGS,  # the MJX engine, which has none, takes Newton
    "newton": mujoco.mjtSolver.mjSOL_NEWTON,
    "cg": mujoco.mjtSolver.mjSOL_CG,
    "pgs": mujoco.mjtSolver.mjSOL_PGS,
}


@dataclasses.dataclass(frozen=True, eq=False)
class CharacterSpec:
    """A compiled model with the look-ups that tasks, motion and engines need.

    Links are the bodies below the world in model order, the free root first. Joints are the
    hinges in model order, which is also the order of the actuators.
    """

    model: mujoco.MjModel
    link_names: tuple[str, ...]  # [L]
    joint_names: tuple[str, ...]  # [J]
    joint_lower: np.ndarray  # [J] rad
    joint_upper: np.ndarray  # [J] rad
    joint_link: np.ndarray  # [J] index of the link that the hinge moves
    torque_limit: np.ndarray  # [J] Nm
    neutral_qpos: np.ndarray  # [7 + J] standing, feet on z = 0
    head_sphere: tuple[int, tuple[float, float, float], float]  # link, centre in it (m), radius (m)
    mirror_joint: np.ndarray  # [J] hinge on the other side
    mirror_sign: np.ndarray  # [J] sign of its angle in the mirror image
    scene: mujoco.MjModel  # what engines simulate: the model, and balls behind it
    ball_names: tuple[str, ...] = ()  # [Q]

    @property
    def num_joints(self) -> int:
        """J, the number of hinges."""
        return len(self.joint_names)

    @property
    def weight(self) -> float:
        """Of all links (N)."""
        return float(self.model.body_mass.sum() * np.linalg.norm(self.model.opt.gravity))

    def link(self, name: str) -> int:
        """Index of a link; an unknown name lists the right ones."""
        return _index(name, self.link_names, "link")

    def links(self, names: Sequence[str]) -> np.ndarray:
        """Indices of several links."""
        return np.array([self.link(name) for name in names], np.int32)

    def joint(self, name: str) -> int:
        """Index of a hinge; an unknown name lists the right ones."""
        return _index(name, self.joint_names, "joint")

    def mirror(self, qpos: np.ndarray) -> np.ndarray:
        """Mirror images of poses [..., 7 + J] in the plane y = 0; twice is the identity."""
        qpos = np.asarray(qpos)
        root = qpos[..., :7] * np.array([1, -1, 1, 1, -1, 1, -1])
        joints = qpos[..., 7:][..., self.mirror_joint] * self.mirror_sign
        return np.concatenate([root, joints], axis=-1)


def load_character(
    config: PhysicsConfig,
    ground: TerrainMap | None = None,
    equipment: Equipment | None = None,
) -> CharacterSpec:
    """Read the MJCF file that the config names and apply the config's physics settings.

    The character stands on its file's floor, a plane, or on the given ground in place of it,
    with the given equipment. Raises ConfigError where the file lacks what docs/character.md lists.
    """
    spec = read_spec(config.character)
    if ground is not None:
        replace_floor(spec, ground)
    balls = equipment.balls if equipment else ()
    if equipment and equipment.racket:
        add_racket(spec)
    model = scene = _compile(spec, config)
    check_character(model, config.character)
    if balls:
        add_balls(spec, balls, FLOOR)
        scene = _compile(spec, config)
    bodies = [model.body(i).name for i in range(1, model.nbody)]
    hinges = hinges_of(model)
    names = tuple(model.joint(i).name for i in hinges)
    mirror_joint, mirror_sign = _mirror_table(model, names)
    return CharacterSpec(
        model=model,
        link_names=tuple(bodies),
        joint_names=names,
        joint_lower=model.jnt_range[hinges, 0].copy(),
        joint_upper=model.jnt_range[hinges, 1].copy(),
        joint_link=model.jnt_bodyid[hinges] - 1,
        torque_limit=model.actuator_forcerange[:, 1].copy(),
        neutral_qpos=model.key("neutral").qpos.copy(),
        head_sphere=_head_sphere(model),
        mirror_joint=mirror_joint,
        mirror_sign=mirror_sign,
        scene=scene,
        ball_names=tuple(ball.name for ball in balls),
    )


def character_file(name: str) -> Path:
    """The MJCF file or map of names of a shipped character, or the path itself of either."""
    own = name.endswith((".xml", SUFFIX))
    path = Path(name) if own else asset_path(f"{name}.xml")
    if not own and not path.is_file():
        path = asset_path(f"{name}{SUFFIX}")
    if not path.is_file():
        shipped = sorted(p.stem for kind in (".xml", SUFFIX) for p in asset_path().glob(f"*{kind}"))
        if not own and Path(name).suffix:
            raise ConfigError(f"physics.character: expected a file .xml or {SUFFIX}, got {name}")
        raise ConfigError(f"physics.character: no file {path}; shipped characters: {shipped}")
    return path


def read_spec(name: str) -> mujoco.MjSpec:
    """The character of a name, a file or a map, as its file has it; raises ConfigError."""
    file = character_file(name)
    try:
        if file.suffix == SUFFIX:
            return read_mapped(file)
        return mujoco.MjSpec.from_file(str(file))
    except ConfigError:
        raise
    except _REFUSALS as error:
        raise _refused(name, error) from None


def _refused(name: str, error: Exception) -> ConfigError:
    """MuJoCo's reason in one line."""
    text = " ".join(str(error).split())
    return ConfigError(f"physics.character: {name}: not a valid MJCF file: {text}")


def _compile(spec: mujoco.MjSpec, config: PhysicsConfig) -> mujoco.MjModel:
    spec.option.timestep = 1.0 / (config.control_hz * config.substeps)
    spec.option.solver = SOLVERS[config.solver]
    spec.option.iterations = config.iterations
    try:
        model = spec.compile()
    except _REFUSALS as error:
        raise _refused(config.character, error) from None
    hinges = slice(6, 6 + model.nu)
    model.dof_armature[hinges] = config.armature
    model.dof_damping[hinges] = config.damping
    model.actuator_gainprm[:, 0] *= config.gain_scale
    model.actuator_biasprm[:, 1:3] *= config.gain_scale
    model.actuator_forcerange *= config.torque_scale
    # the inverse weights that constraints use depend on the armature
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def _head_sphere(model: mujoco.MjModel) -> tuple[int, tuple[float, float, float], float]:
    geom = model.geom("head")
    x, y, z = geom.pos.tolist()
    return int(geom.bodyid[0]) - 1, (x, y, z), float(geom.size[0])


def _mirror_table(model: mujoco.MjModel, names: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
    """The hinge on the other side, and -1 where its axis is not the mirror image.

    An axis of rotation (x, y, z) has the image (-x, y, -z). A wrist that one side alone has keeps
    its angles.
    """
    data = mujoco.MjData(model)
    data.qpos[3:7] = 1.0, 0.0, 0.0, 0.0
    mujoco.mj_kinematics(model, data)
    axes = np.array([data.joint(name).xaxis for name in names])
    other = {"_l_": "_r_", "_r_": "_l_"}
    index, sign = [], []
    for own, name in enumerate(names):
        side = next((s for s in other if s in name), None)
        image = name.replace(side, other[side]) if side else name
        known = image in names
        index.append(names.index(image) if known else own)
        flips = known and axes[own] @ (axes[index[-1]] * [-1, 1, -1]) < 0
        sign.append(-1.0 if flips else 1.0)
    return np.array(index, np.int32), np.array(sign)


def _index(name: str, names: tuple[str, ...], kind: str) -> int:
    if name in names:
        return names.index(name)
    hint = did_you_mean(name, names, "; ")
    raise ConfigError(f"{kind} {name!r}: not in the character{hint} It has {', '.join(names)}")
