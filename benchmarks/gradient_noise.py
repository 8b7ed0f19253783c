"""How many samples a policy gradient needs until it is more signal than noise, by lambda.

    python benchmarks/gradient_noise.py runs/flat [--lambdas 0.95 0.8 0.5] [--rollouts 6]

The newest learner of the run acts with its training's noise, from its training's starts, and does
not learn. Gradients of equal parts of the rollouts are compared: their mean product is the squared
length of the true gradient G, what their own squares have beyond that is noise. The gradient noise
scale tr(Sigma) / |G|^2 (McCandlish et al. 2018) is the number of samples at which both are equal;
SNR is what an iteration of the run has. A small lambda has little noise, and the errors of the
critic instead, which this does not see. Needs a run folder with learner checkpoints, of the get-up
task.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from getup_jax.config import Config
from getup_jax.networks import gaussian
from getup_jax.rl import ppo, schedule
from getup_jax.rl.actor_critic import normalized
from getup_jax.rl.gae import gae
from getup_jax.rl.learner import Learner
from getup_jax.runtime import checkpoint
from getup_jax.training.loop import steps_per_iteration
from getup_jax.training.run import build_job
from support.trained_run import learner_state, load_run, parser_of_run

PARTS = 4  # of the simulations, each with a gradient of its own


class Steps(NamedTuple):
    """T steps of B simulations."""

    observation: jax.Array  # [T, B, O] normalised
    action: jax.Array  # [T, B, A]
    reward: jax.Array  # [T, B, K]
    value: jax.Array  # [T, B, K] where the step began
    next_value: jax.Array  # [T, B, K] where it came, before a reset
    terminated: jax.Array  # [T, B] bool
    truncated: jax.Array  # [T, B] bool


def main() -> None:
    """Print the table of a run."""
    parser = parser_of_run(__doc__, quick="two rollouts")
    parser.add_argument("--lambdas", type=float, nargs="+", default=[0.95, 0.8, 0.5, 0.2])
    parser.add_argument("--rollouts", type=int, default=6, help="as large as those of the run")
    args = parser.parse_args()
    found = load_run(args.run)
    if found is None:
        return
    config, loaded = found
    rollouts = 2 if args.quick else args.rollouts
    gradients = measure(config, loaded, args.lambdas, rollouts, args.seed)
    print(table(config, args.lambdas, gradients))


def measure(
    config: Config,
    loaded: checkpoint.LoadedLearner,
    lambdas: list[float],
    rollouts: int,
    seed: int,
) -> np.ndarray:
    """Policy gradients [PARTS x rollouts, lambdas, weights] of the run's objectives together."""
    job = build_job(config, print)
    learner, world = job.learner, jax.device_put(job.world)
    trained = learner_state(learner, loaded)
    iteration = int(loaded.path.parent.name)  # its checkpoint is called by it
    std = jnp.full(learner.env.action_size, _std(config, iteration))
    key_init, key_roll = jax.random.split(jax.random.PRNGKey(seed))
    state = jax.jit(lambda w: learner.init_environment(w, key_init, config.ppo.num_envs))(world)
    play = jax.jit(lambda w, s, key: _play(learner, trained, std, w, s, key))
    gradient = jax.jit(lambda steps, trace: _gradient(learner, trained, std, steps, trace))
    found = []
    for number in range(rollouts):
        state, steps = play(world, state, jax.random.fold_in(key_roll, number))
        for part in range(PARTS):
            of_part = jax.tree.map(lambda x, p=part: jnp.split(x, PARTS, axis=1)[p], steps)
            found.append([np.asarray(gradient(of_part, trace)) for trace in lambdas])
        print(f"rollout {number + 1} of {rollouts}", flush=True)
    return np.asarray(found)


def _std(config: Config, iteration: int) -> jax.Array:
    """The noise of the stage that the run is in."""
    progress = iteration * steps_per_iteration(config) / config.train.total_steps
    first, last = config.ppo.action_std[0], config.ppo.action_std[-1]
    return schedule.value(first, last, config.ppo.stages, jnp.asarray(progress, jnp.float32))


def _play(
    learner: Learner, trained: Any, std: jax.Array, world: Any, state: Any, key: jax.Array
) -> tuple[Any, Steps]:
    def step(state: Any, key: jax.Array) -> tuple[Any, Steps]:
        seen = normalized(trained.policy, state.observation)
        mean, spread = learner.model.distribution(trained.policy.actor, seen, std)
        action = gaussian.sample(key, mean, spread)
        following, out = learner.env.step(world, state, action)
        values = [learner.value(trained, x) for x in (state.observation, out.final_observation)]
        flags = out.terminated, out.truncated
        return following, Steps(seen, action, out.reward, *values, *flags)

    return jax.lax.scan(step, state, jax.random.split(key, learner.config.num_steps))


def _gradient(
    learner: Learner, trained: Any, std: jax.Array, steps: Steps, trace: jax.Array
) -> jax.Array:
    """The policy gradient [weights] of the weighted, standardised advantages of some steps."""
    rows = (steps.reward, steps.value, steps.next_value, steps.terminated, steps.truncated)
    advantage, _ = gae(*rows, learner.discount, trace)  # pyright: ignore[reportArgumentType]
    advantage = ppo.standardize(advantage) @ jnp.asarray(learner.weights)

    def gain(actor: Any) -> jax.Array:
        mean, spread = learner.model.distribution(actor, steps.observation, std)
        return jnp.mean(gaussian.log_prob(steps.action, mean, spread) * advantage)

    found = jax.grad(gain)(trained.policy.actor)
    return jnp.concatenate([x.ravel() for x in jax.tree.leaves(found)])


def table(config: Config, lambdas: list[float], gradients: np.ndarray) -> str:
    """One line a lambda: SNR of an iteration with its jackknife error, and the noise scale."""
    batch = steps_per_iteration(config)
    lines = ["lambda   SNR of an iteration          noise scale, samples"]
    for column, trace in enumerate(lambdas):
        products = gradients[:, column] @ gradients[:, column].T
        snr, error = snr_of(products)
        snr, error = PARTS * snr, PARTS * error  # a part has the samples of a part
        scale = (
            f"{batch / snr:,.0f}"
            if snr > 2 * error
            else f"more than {batch / (snr + 2 * error):,.0f}"
        )
        lines.append(f"{trace:6.2f}   {snr:8.4f} +- {error:.4f}   {scale:>24}")
    return "\n".join(lines)


def snr_of(products: np.ndarray) -> tuple[float, float]:
    """|G|^2 over the noise of one gradient, and its standard error by jackknife.

    products [M, M]: of M independent gradients with each other.
    """

    def estimate(p: np.ndarray) -> float:
        count, squares = len(p), np.trace(p)
        signal = (p.sum() - squares) / (count * (count - 1))
        return signal / (squares / count - signal)

    count = len(products)
    without = [estimate(np.delete(np.delete(products, i, axis=0), i, axis=1)) for i in range(count)]
    return estimate(products), float(np.std(without) * np.sqrt(count - 1))


if __name__ == "__main__":
    main()
