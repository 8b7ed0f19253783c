"""Pictures of episodes that go on, by one renderer that stays open."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np

from getup_jax import api
from getup_jax.envs.composite.goals import Marker
from getup_jax.evaluation import film
from getup_jax.evaluation.composite_rollout import task_of


class Pictures:
    """Each episode is seen from its side, from where its first picture showed it."""

    def __init__(self, env: api.Env) -> None:
        self._env = env
        self._task = task_of(env.environment)
        self._views: dict[int, film.View] = {}
        self._camera: film.Camera | None = None

    def take(self, state: Any, index: int) -> np.ndarray:
        """A picture [rows, columns, 3] of one episode of a batch.

        Raises ConfigError where this machine cannot render.
        """
        if self._camera is None:
            self._camera = film.Camera(self._task.character.model)
        qpos = np.asarray(self._kinematics(state).qpos[index], np.float64)
        if index not in self._views:
            self._views[index] = film.View.of(self._task.character.model, qpos)
        return self._camera.picture(qpos, self._views[index], self._markers(state, index)).copy()

    def forget(self, ended: np.ndarray) -> None:
        """Look anew at the episodes [B] that have begun."""
        for index in np.flatnonzero(ended):
            self._views.pop(int(index), None)

    def close(self) -> None:
        """Free the renderer."""
        if self._camera is not None:
            self._camera.close()
            self._camera = None

    def _kinematics(self, state: Any) -> Any:
        if self._env.config.composite_motion:
            return self._env.environment.kinematics(state)
        return state.physics.kinematics

    def _markers(self, state: Any, index: int) -> list[Marker]:
        """What the goals of composite motion want to be seen."""
        if not self._env.config.composite_motion or not self._task.goals.names:
            return []
        goals = self._env.environment.goal_states(state)
        one = jax.tree.map(lambda x: np.asarray(x[index]), (goals, self._kinematics(state)))
        return self._task.goals.markers(*one)
