"""How well a run's critic foresees what its policy really earns, by phase of the episode.

    python benchmarks/critic.py runs/flat [--simulations 256] [--seconds 20]

The newest learner of the run acts with its training's noise, from its training's starts. Every
step's value is compared with the discounted return that came until its episode ended (a time limit
counts for the value of where it came). The explained variance that training logs is against targets
that are made of the same values, and says little of their bias; here is both, and the mean error.
Needs a run folder with learner checkpoints, of the get-up task.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from getup_jax.config import Config
from getup_jax.networks import gaussian
from getup_jax.rl.actor_critic import normalized
from getup_jax.rl.gae import gae
from getup_jax.rl.learner import Learner
from getup_jax.runtime import checkpoint
from getup_jax.training.run import build_job
from support.trained_run import learner_state, load_run, parser_of_run

PHASES = ((0.0, 0.25), (0.25, 0.5), (0.5, 0.75), (0.75, 1.0), (1.0, np.inf))


class Steps(NamedTuple):
    """T steps of B simulations; the first of K objectives is looked at."""

    phase: jax.Array  # [T, B] time on the curve as a share of its duration
    reward: jax.Array  # [T, B]
    value: jax.Array  # [T, B] the critic's, where the step began
    next_value: jax.Array  # [T, B] ... and where it came, before a reset
    terminated: jax.Array  # [T, B] bool
    truncated: jax.Array  # [T, B] bool


def main() -> None:
    """Print the table of a run."""
    parser = parser_of_run(__doc__, quick="two seconds")
    parser.add_argument("--simulations", type=int, default=256)
    parser.add_argument("--seconds", type=float, default=20.0, help="of every simulation")
    args = parser.parse_args()
    found = load_run(args.run)
    if found is None:
        return
    config, loaded = found
    seconds = 2.0 if args.quick else args.seconds
    steps = collect(config, loaded, args.simulations, seconds, args.seed)
    print(table(config, steps))


def collect(
    config: Config, loaded: checkpoint.LoadedLearner, simulations: int, seconds: float, seed: int
) -> Steps:
    """Steps of the run's policy with the noise of its last stage."""
    job = build_job(config, print)
    learner: Learner = job.learner
    trained = learner_state(learner, loaded)
    std = jnp.full(learner.env.action_size, config.ppo.action_std[-1])
    key_init, key_roll = jax.random.split(jax.random.PRNGKey(seed))

    def step(world: Any, state: Any, key: jax.Array) -> tuple[Any, Steps]:
        seen = normalized(trained.policy, state.observation)
        mean, spread = learner.model.distribution(trained.policy.actor, seen, std)
        following, out = learner.env.step(world, state, gaussian.sample(key, mean, spread))
        values = (learner.value(trained, x) for x in (state.observation, out.final_observation))
        first = (x[:, 0] for x in (out.reward, *values))
        return following, Steps(state.time / state.duration, *first, out.terminated, out.truncated)

    @jax.jit
    def play(world: Any) -> Steps:
        state = learner.env.init(world, key_init, simulations)
        keys = jax.random.split(key_roll, round(seconds / learner.env.engine.control_dt))
        return jax.lax.scan(lambda state, key: step(world, state, key), state, keys)[1]

    return jax.tree.map(np.asarray, play(jax.device_put(job.world)))


def table(config: Config, steps: Steps) -> str:
    """One line a phase: explained variances, the critic's mean error, and the mean return."""
    flags = (steps.terminated, steps.truncated)
    rows = (steps.reward, steps.value, steps.next_value, *flags, config.ppo.discount)
    returned, target = (np.asarray(gae(*rows, trace)[1]) for trace in (1.0, config.ppo.gae_lambda))
    ended = steps.terminated | steps.truncated
    whole = np.flip(np.cumsum(np.flip(ended, 0), 0), 0) > 0  # the episode ended in time
    lines = ["phase        steps    explained: returns  targets   mean error   mean return"]
    for low, high in ((0.0, np.inf), *PHASES):
        chosen = whole & (steps.phase >= low) & (steps.phase < high)
        if chosen.sum() < 2:
            continue
        value = steps.value[chosen]
        shares = [_explained(value, x[chosen]) for x in (returned, target)]
        error = float((value - returned[chosen]).mean())
        name = f"{low:.2f} - {high:.2f}"
        lines.append(
            f"{name:12} {chosen.sum():8d} {shares[0]:15.3f} {shares[1]:8.3f} {error:+12.2f}"
            f" {returned[chosen].mean():13.2f}"
        )
    return "\n".join(lines)


def _explained(value: np.ndarray, target: np.ndarray) -> float:
    return float(1.0 - np.var(target - value) / np.var(target))


if __name__ == "__main__":
    main()
