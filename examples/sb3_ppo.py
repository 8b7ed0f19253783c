"""PPO of stable-baselines3 learns to stand: the reward rises within a minute or two.

pip install 'getup-jax[sb3]'; python examples/sb3_ppo.py
"""

from __future__ import annotations

import argparse
import time

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecMonitor

import getup_jax.gym


class Report(BaseCallback):
    """Prints what an episode earned, on average, after every rollout."""

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        episodes = self.model.ep_info_buffer
        if episodes:
            mean = np.mean([episode["r"] for episode in episodes])
            length = np.mean([episode["l"] for episode in episodes])
            print(
                f"{self.num_timesteps:7} steps: return {mean:5.2f}, {length:5.1f} steps an episode"
            )


def main() -> None:
    """Train, and say how long it took."""
    parser = argparse.ArgumentParser(description="Train with stable-baselines3's PPO.")
    parser.add_argument("--config", default="quick", help="a config or the name of one")
    parser.add_argument("--num-envs", type=int, default=128)
    parser.add_argument("--steps", type=int, default=60_000)
    args = parser.parse_args()
    torch.set_num_threads(1)  # small networks; the simulations have the cores
    env = VecMonitor(getup_jax.gym.sb3_env(args.config, num_envs=args.num_envs))
    model = PPO(
        "MlpPolicy",
        env,
        n_steps=24,
        batch_size=512,
        n_epochs=5,
        learning_rate=3e-4,
        policy_kwargs={"log_std_init": -0.5, "net_arch": [256, 256]},
        seed=0,
    )
    begin = time.monotonic()
    model.learn(args.steps, callback=Report())
    seconds = time.monotonic() - begin
    print(f"{model.num_timesteps / seconds:.0f} samples/s, {seconds:.0f} s")
    env.close()


if __name__ == "__main__":
    main()
