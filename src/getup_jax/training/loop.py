"""The loop of a training run: iterate, log, save, until the end or a signal."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax

from getup_jax.config import Config
from getup_jax.physics import body_digest
from getup_jax.physics.body_digest import warn_if_other
from getup_jax.rl.state import owned
from getup_jax.runtime import checkpoint, processes
from getup_jax.runtime.console import Display, count, duration
from getup_jax.runtime.metric_file import MetricsWriter, NoMetrics
from getup_jax.runtime.metric_log import REWARD, MetricLog
from getup_jax.runtime.pytree_store import CheckpointError, from_nested, is_finite, to_nested
from getup_jax.runtime.signals import StopRequest
from getup_jax.training.spread import spread

Log = Callable[[str], None]
CarryOver = Callable[[Any, checkpoint.LoadedPolicy, Log], Any]
Step = Callable[[Any, Any], tuple[Any, dict[str, jax.Array]]]

_LEARNING_HINT = "try a lower ppo.learning_rate or ppo.max_gradient_norm"
_REWARD_HINT = f"{_LEARNING_HINT}, or mend the goal or the reward term where it is your own"


class TrainingError(ValueError):
    """Training cannot go on; the text says at which iteration and what to do."""


@dataclasses.dataclass(frozen=True)
class Job:
    """What a run trains."""

    learner: Any  # init(world, key) -> state, iteration(world, state) -> (state, metrics)
    world: Any  # pytree of arrays that every iteration reads
    prior: Any  # pytree saved beside the policy, or None
    # (the run's policy, the checkpoint to begin with, log) -> the policy as this job means it;
    # None: the checkpoint's, as it is
    carry_over: CarryOver | None = None
    # (environment, another's by name, its path) -> with what is not of single simulations
    share: Callable[[Any, Any, str], Any] | None = None
    # (a fresh policy, log) -> what training begins with; None: the fresh one
    prepare: Callable[[Any, Log], Any] | None = None
    body: dict[str, str] | None = None  # digest of the character, see physics/body_digest.py


def steps_per_iteration(config: Config) -> int:
    """Control steps (samples) of one iteration."""
    return config.ppo.num_envs * config.ppo.num_steps


def num_iterations(config: Config) -> int:
    """Iterations of the whole run; the last one may go past `train.total_steps`."""
    return math.ceil(config.train.total_steps / steps_per_iteration(config))


class Loop:
    """A run's state between two iterations, and what is done with it there."""

    def __init__(
        self,
        config: Config,
        folder: Path,
        job: Job,
        display: Display,
        start: checkpoint.LoadedPolicy | None = None,  # of `train.init_from`
    ) -> None:
        self._config, self._job, self._display = config, job, display
        self._checkpoints = folder / checkpoint.CHECKPOINTS
        self._world = jax.device_put(job.world)
        self._state = jax.jit(job.learner.init)(self._world, jax.random.PRNGKey(config.seed))
        self.done = 0  # iterations
        self.saved: Path | None = None  # newest checkpoint
        if checkpoint.steps(self._checkpoints):
            self._restore()
        elif start is not None:
            self._take_over(start)
        elif job.prepare is not None:
            learner = self._state.learner
            self._begin_with(job.prepare(learner.policy, display.log), learner.valuation)
        iteration, self._world, self._state = spread(job.learner, self._world, self._state)
        self._step = self._compile(iteration)

    @property
    def steps(self) -> int:
        """Control steps done; a Python int, since a long run overflows int32."""
        return self.done * steps_per_iteration(self._config)

    def train(self, writer: MetricsWriter | NoMetrics, stop: StopRequest) -> None:
        """Iterate to the end or to a signal; then save."""
        config = self._config.train
        metric_log = MetricLog(writer, self._display, steps_per_iteration(self._config), self.done)
        saved_at = time.monotonic()
        self._display.start(self.steps)
        while self.done < num_iterations(self._config) and not _stops(stop):
            self._iterate(metric_log)
            if self.done % config.log_every == 0:
                metric_log.flush(self.done)
            if _of_first(time.monotonic() - saved_at >= config.save_every_s):
                self._save_if_possible()
                saved_at = time.monotonic()
        metric_log.flush(self.done)
        self._save()

    def _restore(self) -> None:
        restored = checkpoint.restore_learner(self._checkpoints, self._state)
        self._state, self.saved = restored.state, restored.path
        self.done = int(restored.metadata["iteration"])
        self._display.log(f"resuming from {restored.path} at {count(self.steps)} steps")
        warn_if_other(restored.path, restored.metadata, self._job.body, self._display.log)

    def _take_over(self, loaded: checkpoint.LoadedPolicy) -> None:
        self._display.log(f"starting with the policy of {loaded.path}")
        if self._config.train.init_learner:
            self._load_learner(str(self._config.train.init_from))
        policy = self._state.learner.policy  # fresh, or not the average of its weights
        if self._job.carry_over is not None:
            policy = self._job.carry_over(policy, loaded, self._display.log)
        elif not self._config.train.init_learner:
            policy = from_nested(policy, loaded.policy, str(loaded.path))
        self._begin_with(policy, self._loaded_valuation(loaded))

    def _loaded_valuation(self, loaded: checkpoint.LoadedPolicy) -> Any:
        """The critic that came with a policy, or the run's own."""
        own = self._state.learner.valuation
        if loaded.critic is None or self._config.train.init_learner:
            return own
        try:
            found = from_nested(own, loaded.critic, str(loaded.path))
        except CheckpointError as error:
            self._display.log(f"a new critic, since that of the policy does not fit: {error}")
            return own
        judged = " and discriminators" if loaded.critic.get("discriminators") else ""
        self._display.log(f"with its critic{judged}")
        return found

    def _load_learner(self, path: str) -> None:
        loaded = checkpoint.load_learner(path)
        state, where = self._state, str(loaded.path)
        learner = from_nested(state.learner, loaded.learner, where)
        environment = state.environment
        if self._job.share is not None:
            environment = self._job.share(environment, loaded.environment, where)
        self._state = dataclasses.replace(state, learner=learner, environment=environment)
        self._display.log(f"going on with the learner of {where}; the simulations begin anew")

    def _begin_with(self, policy: Any, valuation: Any) -> None:
        # a copy: what the first iteration donates must be nobody else's
        learner = owned(self._state.learner.beginning_with(policy, valuation))
        self._state = dataclasses.replace(self._state, learner=learner)

    def _compile(self, iteration: Step) -> Step:
        """The iteration as one program; nothing can make it compile again during the run."""
        self._display.log("compiling the training iteration ...")
        begin = time.monotonic()
        step = jax.jit(iteration, donate_argnums=1)
        compiled = step.lower(self._world, self._state).compile()
        self._display.log(f"compiled in {duration(time.monotonic() - begin)}; training")
        return compiled

    def _iterate(self, metric_log: MetricLog) -> None:
        self._state, metrics = self._step(self._world, self._state)
        self.done += 1
        bad = metric_log.add({name: float(x) for name, x in jax.device_get(metrics).items()})
        if bad:
            metric_log.flush(self.done)
            rewards = [name for name in bad if name.startswith(REWARD)]  # losses only follow them
            hint = _REWARD_HINT if rewards else _LEARNING_HINT
            raise self._error(f"{', '.join(rewards or bad)}: not a finite number", hint)

    def _save_if_possible(self) -> None:
        """Save; a full disk is no reason to lose a run that may find space next time.

        Of many processes that save together, one that cannot ends the run.
        """
        try:
            self._save()
        except CheckpointError as error:
            if processes.count() > 1:
                raise
            self._display.log(f"warning: {error}")

    def _save(self) -> None:
        if self.saved is not None and int(self.saved.name) == self.done:
            return
        learner = self._state.learner
        parts = {"policy": learner.averaged_policy, "critic": learner.valuation}
        item = to_nested({**parts, "prior": self._job.prior})
        if not is_finite(item):
            raise self._error("a weight of the policy is not a finite number", _LEARNING_HINT)
        metadata: dict[str, Any] = {"steps": self.steps}
        if self._job.body is not None:
            metadata[body_digest.KEY] = self._job.body
        self.saved = checkpoint.save_learner(
            self._checkpoints, self.done, self._state, self._config, item, metadata
        )

    def _error(self, problem: str, hint: str) -> TrainingError:
        good = f"the last good checkpoint is {self.saved}" if self.saved else "nothing was saved"
        return TrainingError(f"iteration {self.done}: {problem}; {good}; {hint}")


def _stops(stop: StopRequest) -> bool:
    """Whether a signal came, to any process: all end with the same iteration."""
    if processes.count() > 1:
        stop.signal = int(processes.gathered([stop.signal or 0]).max()) or None
    return stop.signal is not None


def _of_first(due: bool) -> bool:
    """The first process's answer, for all: clocks differ."""
    return due if processes.count() == 1 else bool(processes.gathered([due])[0, 0])
