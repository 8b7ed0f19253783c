"""One character that is steered by a script: policies are switched, and targets set, as it runs."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import numpy as np

from getup_jax.config import Config, ConfigError
from getup_jax.envs.composite.goals import Marker
from getup_jax.envs.composite.goals.combine import equipment_of
from getup_jax.envs.composite.task import CompositeTask
from getup_jax.evaluation.composite import evaluation_config
from getup_jax.evaluation.composite_film import write
from getup_jax.evaluation.composite_rollout import restore, task_of, without_noise
from getup_jax.evaluation.scenario import Scenario
from getup_jax.evaluation.steering_script import Command, Script
from getup_jax.runtime.checkpoint import LoadedPolicy, load_policy
from getup_jax.runtime.console import Display
from getup_jax.training.run import Log


@dataclasses.dataclass(frozen=True, eq=False)
class Player:
    """A trained policy that can take over the character at any time."""

    env: Any  # CompositeTask, or MetaTask around it
    world: Any
    policy: Any
    begin: Callable[..., Any]  # (world, key) -> state of one fresh episode
    step: Callable[..., tuple[Any, Any]]  # (world, policy, state, goals) -> state, StepOutput
    adopt: Callable[..., Any]  # (world, task's state, goals, key) -> state, see CompositeTask.adopt
    new_goals: Callable[..., tuple[Any, ...]]  # (key, kinematics) -> states of the goal tasks

    @property
    def task(self) -> CompositeTask:
        """The task without a meta policy."""
        return task_of(self.env)

    def goal_states(self, state: Any) -> tuple[Any, ...]:
        """The states of the goal tasks, in their order."""
        return self.env.goal_states(state)


@dataclasses.dataclass(frozen=True, eq=False)
class Course:
    """What happened, T control steps."""

    qpos: np.ndarray  # [T, 7 + J]
    markers: list[list[Marker]]  # [T]
    lines: list[str]  # [T] what the character is told
    results: list[dict[str, Any]]  # of every target: when, what, mean reward, reached after (s)
    fell_s: float | None  # when it first fell


def steer(loaded: LoadedPolicy, scenario: Scenario, script: Script) -> tuple[Course, CompositeTask]:
    """Run a script with a policy and those that it switches to; also the task that they share."""
    config = evaluation_config(loaded.config, scenario)
    with Display(len(script.commands), unit="commands") as display:
        players = load_players(loaded, config, script, display.log)
        return run_script(players, script, scenario.seed), players[None].task


def film(path: Path, env: CompositeTask, course: Course, size: tuple[int, int]) -> None:
    """The whole course, with what the character is told; size: rows and columns."""
    write(path, env, [(course.qpos, course.markers, course.lines)], size)


def to_json(course: Course) -> dict[str, Any]:
    """What became of every command, and when the character fell."""
    return {"results": course.results, "fell_s": course.fell_s}


def load_players(
    loaded: LoadedPolicy, config: Config, script: Script, log: Log
) -> dict[str | None, Player]:
    """The first policy (None) and all that the script names.

    Raises ConfigError where one is of another character, or a goal is not among its policy's.
    """
    found: dict[str | None, tuple[LoadedPolicy, Config]] = {None: (loaded, config)}
    for name in dict.fromkeys(command.policy for command in script.commands):
        if name is not None:
            other = load_policy(name)
            check_alike(other, config, f"--script: policy {name}")
            found[name] = (other, dataclasses.replace(other.config, seed=config.seed))
    _check_goals(script, {name: set(_goals(pair[1])) for name, pair in found.items()})
    return {name: player_of(*pair, log) for name, pair in found.items()}


def run_script(players: dict[str | None, Player], script: Script, seed: int) -> Course:
    """The script from a random start of the first policy's task; policies act with their means."""
    player = players[None]
    dt = player.task.engine.control_dt
    key_start, key_switch = jax.random.split(jax.random.PRNGKey(seed))
    state = player.begin(player.world, key_start)
    told = _Told()
    waiting = list(script.commands)
    qpos, markers, lines, fell_s, name = [], [], [], None, ""
    for step in range(round(script.duration_s / dt)):
        now = step * dt
        while waiting and waiting[0].at_s <= now + 1e-6:
            command = waiting.pop(0)
            if command.policy is not None:
                name = Path(command.policy).name
                last, player = player, players[command.policy]
                state = switch(last, player, state, jax.random.fold_in(key_switch, step))
            told.hear(command, now)
        goals = player.task.goals.steer(
            player.goal_states(state), told.orders(player.task.goals.names, now)
        )
        state, output = player.step(player.world, player.policy, state, goals)
        told.see(player, state, output, now + dt)
        if fell_s is None and bool(output.terminated[0]):
            fell_s = now + dt
        one = jax.tree.map(lambda x: np.asarray(x)[0], player.env.kinematics(state))
        shown = jax.tree.map(lambda x: np.asarray(x)[0], player.goal_states(state))
        qpos.append(one.qpos)
        markers.append(player.task.goals.markers(shown, one))
        lines.append(" ".join(part for part in (f"{now:.1f} s", name, told.text) if part))
    return Course(np.stack(qpos), markers, lines, told.results(), fell_s)


class _Told:
    """The orders that hold now, and what came of each."""

    def __init__(self) -> None:
        self._now: dict[str, dict[str, Any]] = {}
        self._all: list[dict[str, Any]] = []

    def hear(self, command: Command, now: float) -> None:
        for goal, order in command.targets.items():
            heard = {"goal": goal, "order": order, "at_s": now, "rewards": [], "reached": None}
            self._now[goal] = heard
            self._all.append(heard)

    def orders(self, names: tuple[str, ...], now: float) -> dict[str, tuple[dict, float]]:
        """Of the goals that the acting policy knows: the order and its age (s)."""
        held = {goal: heard for goal, heard in self._now.items() if goal in names}
        return {goal: (heard["order"], now - heard["at_s"]) for goal, heard in held.items()}

    def see(self, player: Player, state: Any, output: Any, now: float) -> None:
        """Note the reward, and the moment when a target was reached."""
        task = player.task
        for index, (name, goal) in enumerate(
            zip(task.goals.names, player.goal_states(state), strict=True)
        ):
            heard = self._now.get(name)
            if heard is None:
                continue
            heard["rewards"].append(float(output.reward[0, len(task.groups) + index]))
            reached = getattr(goal, "reached", None)
            if heard["reached"] is None and reached is not None and bool(reached[0]):
                heard["reached"] = now - heard["at_s"]

    @property
    def text(self) -> str:
        """All orders that hold, for the film."""
        return Command(0.0, None, {g: heard["order"] for g, heard in self._now.items()}).text

    def results(self) -> list[dict[str, Any]]:
        """What came of every order."""
        return [
            {
                "at_s": heard["at_s"],
                "goal": heard["goal"],
                "order": heard["order"],
                "reward": float(np.mean(heard["rewards"])) if heard["rewards"] else None,
                "reached_after_s": heard["reached"],
            }
            for heard in self._all
        ]


def switch(last: Player, player: Player, state: Any, key: jax.Array) -> Any:
    """The episode goes on with another policy; goals that it shares with the last one stay."""
    task = last.env.task_state(state)
    kept = dict(zip(last.task.goals.names, task.goals, strict=True))
    fresh = player.new_goals(key, task.physics.kinematics)
    names = player.task.goals.names
    goals = tuple(kept.get(name, new) for name, new in zip(names, fresh, strict=True))
    return player.adopt(player.world, task, goals, key)


def player_of(loaded: LoadedPolicy, config: Config, log: Log) -> Player:
    """A policy in its task, which is built here."""
    log(f"{loaded.path}: {loaded.metadata.get('steps', 0):,} steps of training")
    found = restore(config, loaded, log)
    learner = found.job.learner
    env = without_noise(learner.env)

    def step(world: Any, policy: Any, state: Any, goals: Any) -> tuple[Any, Any]:
        task = env.task_state(state)
        state = env.adopt(world, task, goals, task.key)
        state, output = env.advance(world, state, learner.act(policy, state.observation))
        # what nobody looks at is not computed
        return state, output.replace(metrics={}, episode={}, extras=None)

    compiled = jax.jit(env.adopt)

    def adopt(world: Any, state: Any, goals: Any, key: jax.Array) -> Any:
        # without what is made anew and differs from policy to policy: one program for all
        own = ("observation", "goals", "attempts", "successes", "key")
        return compiled(world, state.replace(**dict.fromkeys(own)), goals, key)

    begin = jax.jit(lambda world, key: env.init(world, key, 1))
    world = jax.device_put(found.job.world)
    new_goals = jax.jit(task_of(env).goals.reset)
    return Player(env, world, found.policy, begin, jax.jit(step), adopt, new_goals)


def _goals(config: Config) -> dict[str, Any]:
    assert config.composite is not None  # `check_alike` has seen to it
    return config.composite.goals


def check_alike(other: LoadedPolicy, config: Config, where: str) -> None:
    """Raise ConfigError unless a policy moves the same character in the same simulation."""
    if not other.config.composite_motion:
        raise ConfigError(f"{where}: is of the get-up task; expected one of composite motion")
    check_physics(other.config, config, where)
    if equipment_of(_goals(other.config)) != equipment_of(_goals(config)):
        raise ConfigError(
            f"{where}: plays with other balls or rackets than the first policy; expected the same"
        )


def check_physics(other: Config, config: Config, where: str) -> None:
    """Raise ConfigError unless both have the same character and the same simulation."""
    body, first = other.physics.character, config.physics.character
    if body != first:
        raise ConfigError(
            f"{where}: moves another character ({body}) than the first policy ({first}); "
            "expected a policy of the same one"
        )
    if dataclasses.replace(other.physics, threads=0, engine=config.physics.engine) != (
        dataclasses.replace(config.physics, threads=0)
    ):
        raise ConfigError(
            f"{where}: was trained with other physics ({other.physics}) than the first "
            f"policy ({config.physics}); one character cannot go on with both"
        )


def _check_goals(script: Script, known: dict[str | None, set[str]]) -> None:
    """Whether each target is a goal of the policy that acts then."""
    acting: str | None = None
    for command in script.commands:
        acting = command.policy or acting
        for goal in command.targets:
            if goal not in known[acting]:
                has = ", ".join(sorted(known[acting])) or "none"
                raise ConfigError(
                    f"--script: at {command.at_s:g} s: {goal}: the policy that acts then "
                    f"({acting or 'of --ckpt'}) has the goals: {has}"
                )


def table(course: Course) -> str:
    """What became of every command, in lines for people."""
    lines = []
    for result in course.results:
        said = Command(0.0, None, {result["goal"]: result["order"]}).text
        reward = "-" if result["reward"] is None else f"{result['reward']:.2f}"
        after = result["reached_after_s"]
        reached = "" if after is None else f", reached after {after:.1f} s"
        lines.append(f"{result['at_s']:6.1f} s  {said}: mean reward {reward}{reached}")
    fell = "did not fall" if course.fell_s is None else f"fell at {course.fell_s:.1f} s"
    return "\n".join([*lines, fell])
