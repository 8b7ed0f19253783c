"""Start states for edited curves: the same that an evaluation of the curve's file begins with."""

from __future__ import annotations

import collections
import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from getup_jax.config import CurriculumConfig, TaskConfig
from getup_jax.core.types import take
from getup_jax.envs.getup.build import BuiltTask
from getup_jax.envs.getup.episode import LYING
from getup_jax.envs.getup.resets.pool import FlatStarts, Pool, angle_gap, build_pool
from getup_jax.motion.clips import Clip, GetUp, MotionError
from getup_jax.motion.getup import events
from getup_jax.motion.getup.events import link_positions
from getup_jax.motion.getup.getups import clip_features
from getup_jax.motion.io.curve_file import LIMITS, CurveFile
from getup_jax.physics.character import CharacterSpec
from getup_jax.physics.terrain_map import REGIONS

_KEPT = 256  # start states kept, by what they start from


@dataclasses.dataclass(frozen=True)
class Place:
    """Where on irregular ground; a flat plane has one place."""

    region: int = 0  # index into REGIONS
    number: int = 0  # of the rag-dolls there that lie as the start does


ANYWHERE = Place()


class Starts:
    """Pools of one lying start each; all have one form, so that one program serves them all."""

    def __init__(self, task: BuiltTask, config: TaskConfig, seed: int) -> None:
        self._task, self._config, self._seed = task, config, seed
        self.clips: dict[str, Clip] = {g.name: g.clip for g in task.getups if g.clip is not None}
        self._pools: collections.OrderedDict[object, Pool] = collections.OrderedDict()

    @property
    def character(self) -> CharacterSpec:
        """The character, on the ground that it trains on."""
        return self._task.environment.character

    @property
    def places(self) -> int:
        """How many places a region has; 0 on a flat plane."""
        pool = self._task.world.pool
        return 0 if pool.startable is None else pool.table.shape[-1]

    def pool(self, curve: CurveFile, place: Place) -> Pool:
        """The pool with the curve's start in each row of its table [3, R, 1, 1]."""
        pose = None if curve.pose is None else curve.pose.tobytes()
        key = (curve.start, pose, place)
        if key not in self._pools:
            self._pools[key] = self._make(curve, place)
        self._pools.move_to_end(key)
        while len(self._pools) > _KEPT:
            self._pools.popitem(last=False)
        return self._pools[key]

    def gap(self, curve: CurveFile) -> float:
        """Largest difference of the start pose's torso angles from the curve's first (rad)."""
        clip = curve.start_clip(self.clips, self.character)
        return angle_gap(clip.qpos[0], curve.getups()[0], self.character)

    def _make(self, curve: CurveFile, place: Place) -> Pool:
        clip = curve.start_clip(self.clips, self.character)
        if self.places == 0:
            # its own first angles, so that every curve may start from it
            own = dataclasses.replace(curve, values=_first_angles(clip, self.character))
            getups = own.getups(clip)[:1]
            engine = self._task.environment.engine
            size = self._task.environment.action_size
            none = CurriculumConfig()
            flat = FlatStarts(getups, self.character, self._config, none, self._seed, size)
            return build_pool(flat, engine, lambda _: None)
        return self._on_ground(curve, place)

    def _on_ground(self, curve: CurveFile, place: Place) -> Pool:
        pool, names = self._task.world.pool, [getup.name for getup in self._task.getups]
        if curve.start not in names or pool.startable is None:
            raise MotionError(
                f"{curve.name}: start: on irregular ground expected one of {', '.join(names)}, got "
                f"{curve.start!r}; choose one of them"
            )
        region, style = place.region, names.index(curve.start)
        startable = np.asarray(pool.startable.styles)[region]
        if style not in startable[: int(pool.startable.count[region])]:
            raise MotionError(
                f"{curve.name}: start: nothing in the region {REGIONS[region]!r} lies like "
                f"{curve.start!r}; choose another start or region"
            )
        row = pool.table[LYING, region, style, place.number % self.places]
        index = jnp.full(3, row)
        table = jnp.zeros((3, len(REGIONS), 1, 1), jnp.int32)
        return Pool(jax.tree.map(jnp.asarray, take(pool.physics, index)), pool.time[index], table)


def lies(clip: Clip, character: CharacterSpec) -> str:
    """supine, prone or side: how the motion's first pose lies."""
    positions = link_positions(dataclasses.replace(clip, qpos=clip.qpos[:1]), character)
    return events.orientation(float(events.heights_of(positions, character).front_up[0]))


def reference_curve(getup: GetUp) -> CurveFile:
    """A reference motion's own curve, rounded to what a person would write."""
    values = getup.points.copy()
    values[:, 1:] = np.degrees(values[:, 1:])
    return CurveFile(
        name=getup.name,
        strategy=getup.strategy or "unclassified",
        start=getup.name,
        durations=(round(getup.duration, 2),),
        values=np.clip(values.round(3), *np.transpose(LIMITS)),
    )


def _first_angles(clip: Clip, character: CharacterSpec) -> np.ndarray:
    """Control points [9, 3] (m, degrees) that stay where the clip starts."""
    positions = link_positions(dataclasses.replace(clip, qpos=clip.qpos[:1]), character)
    value = clip_features(positions, character)[0]
    return np.tile(value * [1.0, 180.0 / np.pi, 180.0 / np.pi], (9, 1))
