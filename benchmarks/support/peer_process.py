"""One trainer of `benchmarks/peers.py` in a process of its own: an iteration for every line.

    python -m support.peer_process PEER SETTING

PEER: ours, sb3 (stable-baselines3 on our VectorEnv), sb3:N (on N processes of one MuJoCo simulation
each), brax. SETTING is JSON: config, settings, num_envs, num_steps, folder. It answers in JSON
lines: {"ready": true}, then samples, seconds and success (of the episodes that ended; null: none
did) of every iteration; or {"missing": TEXT} where the peer is not installed.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from getup_jax.config import Config, PPOConfig
from getup_jax.config.load import load_config


class Pace:
    """Waits until it is told to go on, and says how long what came between took."""

    def __init__(self) -> None:
        self._begin: float | None = None

    def mark(self, samples: int, success: float | None) -> None:
        """An iteration is over, and another one begins once there is a line; none: the end."""
        seconds = None if self._begin is None else time.perf_counter() - self._begin
        if seconds is None:
            answer({"ready": True})
        else:
            answer({"samples": samples, "seconds": seconds, "success": success})
        if not sys.stdin.readline():
            sys.exit(0)
        self._begin = time.perf_counter()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("peer")
    parser.add_argument("setting", type=json.loads)
    args = parser.parse_args()
    setting = args.setting
    config = load_config(setting["config"], setting["settings"])
    sizes = {name: setting[name] for name in ("num_envs", "num_steps", "minibatch_size")}
    config = dataclasses.replace(config, ppo=dataclasses.replace(config.ppo, **sizes))
    kind, _, processes = args.peer.partition(":")
    run: Callable[..., None] = {"ours": ours, "sb3": stable_baselines, "brax": brax}[kind]
    try:
        if processes:
            run(config, Path(setting["folder"]), int(processes))
        else:
            run(config)
    except ImportError as error:
        answer({"missing": str(error)})


def ours(config: Config) -> None:
    """`getup-train`, without what it writes."""
    import jax

    from getup_jax.training.run import build_job

    job = build_job(config, _silent)
    options = getattr(getattr(job.learner.env, "engine", None), "compiler_options", None)
    state = jax.jit(job.learner.init)(job.world, jax.random.PRNGKey(config.seed))
    iterate = jax.jit(job.learner.iteration, donate_argnums=1, compiler_options=options)
    pace, samples = Pace(), config.ppo.num_envs * config.ppo.num_steps
    iterate = iterate.lower(job.world, state).compile()
    success: float | None = None
    while True:
        pace.mark(samples, success)
        state, metrics = jax.block_until_ready(iterate(job.world, state))
        success = _success(metrics)


def _success(metrics: dict[str, Any]) -> float | None:
    """Of standing starts, where there are any; of lying ones otherwise."""
    for name in ("stand_success", "success"):
        value = float(metrics.get(f"episode/{name}", math.nan))
        if math.isfinite(value):
            return value
    return None


def stable_baselines(config: Config, folder: Path | None = None, processes: int = 0) -> None:
    """Its PPO, on processes of a simulation each, or on all simulations in our VectorEnv."""
    import torch  # pyright: ignore[reportMissingImports]
    from stable_baselines3 import PPO  # pyright: ignore[reportMissingImports]
    from stable_baselines3.common.callbacks import (  # pyright: ignore[reportMissingImports]
        BaseCallback,
    )
    from stable_baselines3.common.vec_env import (  # pyright: ignore[reportMissingImports]
        SubprocVecEnv,
        VecNormalize,
    )

    torch.set_num_threads(1)  # small networks; the simulations have the cores
    ppo = config.ppo
    if folder is not None:
        from support.numpy_task import NumpyGetUp

        # forked: nothing here has threads yet, and they share what this process has loaded
        envs = SubprocVecEnv([lambda: NumpyGetUp(folder)] * processes, start_method="fork")
    else:
        import getup_jax.gym

        plain = dataclasses.replace(config, curriculum=None)
        processes, envs = ppo.num_envs, getup_jax.gym.sb3_env(plain, num_envs=ppo.num_envs)
    steps = max(1, ppo.num_envs * ppo.num_steps // processes)
    pace, ended = Pace(), []

    class Stops(BaseCallback):
        """Between two iterations."""

        def _on_step(self) -> bool:
            ended.extend(x["is_success"] for x in self.locals["infos"] if "is_success" in x)
            return True

        def _on_rollout_start(self) -> None:
            pace.mark(steps * processes, float(np.mean(ended)) if ended else None)
            ended.clear()

    normal = VecNormalize(envs, norm_reward=False, clip_obs=math.inf)
    model = PPO("MlpPolicy", normal, n_steps=steps, device="cpu", **sb3_settings(config, torch))
    model.learn(10**9, callback=Stops())


def sb3_settings(config: Config, torch: Any) -> dict[str, Any]:
    """The arguments of its PPO that mean what the config says."""
    ppo: PPOConfig = config.ppo
    layers = list(config.network.hidden_sizes)
    return {
        "batch_size": ppo.minibatch_size,
        "n_epochs": ppo.epochs,
        "learning_rate": ppo.learning_rate[0],
        "gamma": ppo.discount,
        "gae_lambda": ppo.gae_lambda,
        "clip_range": ppo.clip,
        "ent_coef": ppo.entropy_coefficient,
        "max_grad_norm": ppo.max_gradient_norm,
        "seed": config.seed,
        "policy_kwargs": {
            "net_arch": {"pi": layers, "vf": layers},
            "activation_fn": torch.nn.ReLU,
            "log_std_init": math.log(ppo.action_std[0]),
        },
    }


def brax(config: Config) -> None:
    """Its PPO on MJX, with our task around it."""
    from brax.training.agents.ppo import networks, train  # pyright: ignore[reportMissingImports]

    from support.brax_task import make_task

    ppo, pace = config.ppo, Pace()
    physics = dataclasses.replace(config.physics, engine="mjx", solver="auto")
    plain = dataclasses.replace(config, physics=physics, curriculum=None)
    samples = ppo.num_envs * ppo.num_steps
    unrolls = ppo.minibatch_size // ppo.num_steps  # a minibatch is made of whole ones
    iterations = 10**6

    def stop(*_: Any) -> None:
        pace.mark(samples, None)

    def network(*sizes: Any, **options: Any) -> Any:
        layers: Sequence[int] = config.network.hidden_sizes
        return networks.make_ppo_networks(
            *sizes, policy_hidden_layer_sizes=layers, value_hidden_layer_sizes=layers, **options
        )

    train.train(
        make_task(plain, ppo.num_envs),
        num_timesteps=iterations * samples,
        num_evals=iterations + 1,
        wrap_env=False,
        run_evals=False,
        num_envs=ppo.num_envs,
        episode_length=10**6,
        learning_rate=ppo.learning_rate[0],
        entropy_cost=ppo.entropy_coefficient,
        discounting=ppo.discount,
        gae_lambda=ppo.gae_lambda,
        clipping_epsilon=ppo.clip,
        max_grad_norm=ppo.max_gradient_norm,
        unroll_length=ppo.num_steps,
        batch_size=unrolls,
        num_minibatches=ppo.num_envs // unrolls,
        num_updates_per_batch=ppo.epochs,
        normalize_observations=True,
        network_factory=network,
        policy_params_fn=stop,
        seed=config.seed,
    )


def answer(value: Any) -> None:
    print(json.dumps(value), flush=True)


def _silent(text: str) -> None:
    """Only answers go to the standard output."""


if __name__ == "__main__":
    main()
