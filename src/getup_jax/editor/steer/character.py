"""One character on the floor: which policy acts, what it is told, and what becomes of it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

import jax
import numpy as np

from getup_jax.core.types import Kinematics, PhysicsState
from getup_jax.editor.steer import recovery
from getup_jax.editor.steer.orders import Told
from getup_jax.envs.composite.goals import Marker
from getup_jax.envs.composite.task import CompositeState
from getup_jax.evaluation.steering import Player, switch
from getup_jax.physics.push import push

LIES_S = 2.0  # after a fall without a get-up policy
_RESTS_S = 1.0  # the same, until a get-up policy takes over
_PUSH_M_S = 1.5  # change of the whole body's velocity


@dataclasses.dataclass(frozen=True, eq=False)
class Frame:
    """What is shown of one control step."""

    links: np.ndarray  # [L, 7] float32: position (m) and quaternion (wxyz) of every link
    said: dict[str, Any]  # plain values: time, who acts, goals, markers, and what happened


class Character:
    """Steps one episode; policies act with their means.

    players: compiled policies by name, the first one begins; more may come while it runs.
    rising: what gets it up after a fall; None: it is put back on its feet.
    """

    def __init__(
        self, players: Mapping[str, Player], rising: recovery.Rising | None, seed: int
    ) -> None:
        self._players, self._rising = players, rising
        self._key = jax.random.PRNGKey(seed)
        self.name = next(iter(players))  # of the policy that acts
        self._limp = recovery.limp(self._player.task.engine)
        self.restart()

    @property
    def _player(self) -> Player:
        return self._players[self.name]

    @property
    def _episode(self) -> CompositeState:
        return self._player.env.task_state(self._state)

    def restart(self) -> None:
        """Begin anew at the origin, told nothing."""
        self._state = recovery.fresh(self._player, self._new_key(), np.zeros(2))
        self._told, self._now, self._falls = Told(), 0.0, 0
        self._lain: float | None = None  # s since the fall; None: it acts
        self._getting_up: Any = None  # state of the get-up policy, while that acts
        self._words = ""

    def compile(self) -> None:
        """Do once whatever takes long when it is first done, and begin anew."""
        for goal in self._player.task.goals.goals:
            numbers = getattr(goal, "orders", {})
            zeros = {k: (0.0,) * n if n > 1 else 0.0 for k, (n, _) in numbers.items()}
            if zeros:
                self.order(goal.name, zeros)
        self.step()
        self._state = switch(self._player, self._player, self._state, self._new_key())
        self.push(0.0)
        self._go_on(self._limp(self._episode.physics))
        if self._rising is not None:
            self._begin_to_rise()
            self._get_up()
        self._put_back(*self._where())
        self.restart()

    def order(self, goal: str, order: dict[str, Any]) -> None:
        """Set the target of a goal, for all policies that know it."""
        self._told.hear(goal, order)

    def switch(self, name: str) -> None:
        """Another policy acts from now on; pose, velocities and shared targets stay."""
        if name != self.name:
            last, self.name = self._player, name
            self._state = switch(last, self._player, self._state, self._new_key())

    def push(self, yaw: float) -> None:
        """Push the root along a direction on the floor (rad)."""
        task, episode = self._player.task, self._episode
        strength = _PUSH_M_S * float(task.character.model.body_mass.sum())
        impulse = strength * np.array([[math.cos(yaw), math.sin(yaw), 0.0]])
        physics = push(task.engine, task.character, episode.physics, impulse, link=0)
        self._adopt(episode.replace(physics=physics))
        if self._lain is not None:  # what was getting up begins again
            self._lain, self._getting_up = 0.0, None

    def step(self) -> Frame:
        """One control step."""
        now, self._now = self._now, self._now + self._player.task.engine.control_dt
        rewards: dict[str, float] = {}
        where = self._where()
        if self._getting_up is not None:
            self._get_up()
        elif self._lain is not None:
            self._lie()
        else:
            rewards = self._act(now)
        if not bool(self._episode.physics.kinematics.finite[0]):
            self._words = "The simulation failed"
            self._put_back(*where)
        return self._frame(rewards)

    def _act(self, now: float) -> dict[str, float]:
        """A step of the policy from a time (s) on; the rewards of its goals."""
        player, names = self._player, self._player.task.goals.names
        goals = player.task.goals.steer(
            player.goal_states(self._state), self._told.orders(names, now)
        )
        self._state, output = player.step(player.world, player.policy, self._state, goals)
        self._told.see(names, player.goal_states(self._state), self._now)
        if bool(output.terminated[0]):
            self._lain, self._falls = 0.0, self._falls + 1
            cause = next(name for name, ended in output.ended.items() if bool(ended[0]))
            self._words = "It fell" if cause == "fall" else f"{cause}: failed"
            return {}  # what a fall costs is no reward of a goal
        values = np.asarray(output.reward)[0, len(player.task.groups) :]
        return dict(zip(names, values.tolist(), strict=False))

    def _lie(self) -> None:
        assert self._lain is not None
        self._lain += self._player.task.engine.control_dt
        self._go_on(self._limp(self._episode.physics))
        if self._rising is not None and self._lain >= _RESTS_S:
            self._begin_to_rise()
        elif self._lain >= LIES_S:
            self._put_back(*self._where())

    def _begin_to_rise(self) -> None:
        assert self._rising is not None
        seen = self._episode.physics.kinematics
        self._getting_up = self._rising.begin(np.asarray(seen.qpos), np.asarray(seen.qvel))

    def _get_up(self) -> None:
        assert self._rising is not None
        self._getting_up = self._rising.step(self._getting_up)
        physics = self._player.task.engine.place(*self._rising.pose(self._getting_up))
        self._go_on(physics)
        stands = self._rising.stands(self._getting_up)
        if stands:
            self._lain, self._getting_up, self._words = None, None, "It stood up by itself"
        elif stands is False:
            self._words = "It did not manage to stand up"
            self._put_back(*self._where())

    def _put_back(self, place: np.ndarray, yaw: float) -> None:
        self._state = recovery.fresh(self._player, self._new_key(), place, yaw)
        self._lain, self._getting_up = None, None
        self._words += ": it was put back on its feet"

    def _adopt(self, episode: CompositeState) -> None:
        """The acting policy goes on from there, with the goals it has."""
        player = self._player
        goals = player.goal_states(self._state)
        self._state = player.adopt(player.world, episode, goals, self._new_key())

    def _go_on(self, physics: PhysicsState) -> None:
        """The episode after a control step that no policy of composite motion took."""
        history = recovery.followed(self._episode.history, physics)
        self._adopt(self._episode.replace(physics=physics, history=history))

    def _where(self) -> tuple[np.ndarray, float]:
        """Where the root is [2] (m), and which way it faces (rad)."""
        qpos = np.asarray(self._episode.physics.kinematics.qpos)[0]
        return qpos[:2], 2.0 * math.atan2(qpos[6], qpos[3])

    def _new_key(self) -> jax.Array:
        self._key, key = jax.random.split(self._key)
        return key

    def _frame(self, rewards: Mapping[str, float]) -> Frame:
        player = self._player
        one: Kinematics = jax.tree.map(lambda x: np.asarray(x)[0], self._episode.physics.kinematics)
        states = jax.tree.map(lambda x: np.asarray(x)[0], player.goal_states(self._state))
        goals = {
            goal.name: {
                "reward": rewards.get(goal.name),
                "told": self._told.plain(goal.name),
                "markers": [_plain(marker) for marker in goal.markers(state, one)],
            }
            for goal, state in zip(player.task.goals.goals, states, strict=True)
        }
        said = {"time": round(self._now, 3), "policy": self.name, "goals": goals}
        said |= {"falls": self._falls, "words": self._words, "phase": self._phase()}
        said["on_feet_in_s"] = self._on_feet_in()
        said["balls"] = [
            _plain(Marker(place, radius=ball.radius_m, rgba=ball.rgba))
            for ball, place in zip(player.task.goals.balls, _balls(one), strict=True)
        ]
        return Frame(np.concatenate([one.link_position, one.link_quaternion], axis=1), said)

    def _on_feet_in(self) -> float | None:
        """Seconds until it is put back on its feet; None: it is not, or gets up by itself."""
        if self._lain is None or self._rising is not None:
            return None
        return round(max(LIES_S - self._lain, 0.0), 2)

    def _phase(self) -> str:
        if self._lain is None:
            return "acts"
        return "lies" if self._getting_up is None else "rises"


def _balls(seen: Kinematics) -> Any:
    return [] if seen.prop_position is None else seen.prop_position


def _plain(marker: Marker) -> dict[str, Any]:
    """A marker as plain values."""
    reach = None if marker.reach is None else np.round(marker.reach, 4).tolist()
    place = np.round(marker.position, 4).tolist()
    return {"position": place, "reach": reach, "radius": marker.radius, "rgba": marker.rgba}
