"""Networks, PPO and the run."""

from __future__ import annotations

import dataclasses

from getup_jax.config.check import require


@dataclasses.dataclass(frozen=True)
class NetworkConfig:
    """Actor and critic: separate multilayer perceptrons."""

    hidden_sizes: tuple[int, ...] = (256, 256)
    activation: str = "relu"  # relu | tanh | elu | silu | relu6
    # what is done in the mirror image of a state is the mirror image of what is done in the state,
    # by construction; where the task has a mirror image, which composite motion has not
    mirror: bool = True
    gru_size: int = 256  # GRU in front of both, where the task observes a history of frames
    # first std of actions that the actor gives for each state; None: ppo.action_std for all
    initial_std: float | None = None
    std_range: float = 2.0  # how far the actor may move it either way, in e-folds

    def __post_init__(self) -> None:
        require(self.gru_size > 0, "network.gru_size", "more than 0", self.gru_size)
        std = self.initial_std
        require(std is None or std > 0, "network.initial_std", "more than 0, or null", std)
        ok = self.std_range >= 0
        require(ok, "network.std_range", "at least 0", self.std_range)
        names = ("relu", "tanh", "elu", "silu", "relu6")
        ok = self.activation in names
        require(ok, "network.activation", f"one of {names}", self.activation)


@dataclasses.dataclass(frozen=True)
class PPOConfig:
    """PPO-Clip with GAE."""

    num_envs: int = 512  # B
    num_steps: int = 64  # T
    epochs: int = 4
    minibatch_size: int = 2048
    discount: float = 0.99
    gae_lambda: float = 0.95
    clip: float = 0.2
    value_coefficient: float = 0.5
    entropy_coefficient: float = 0.0
    max_gradient_norm: float = 0.5
    learning_rate: tuple[float, ...] = (1e-4, 2e-5)  # first and last stage
    critic_rate_scale: float = 1.0  # times the learning rate, for the critic
    action_std: tuple[float, ...] = (0.6, 0.3)  # first and last stage
    # times the std that the actor gives (network.initial_std), first and last stage
    std_scale: tuple[float, ...] = (1.0, 1.0)
    stages: int = 5  # equal stages of the whole run, for all schedules
    target_clip_fraction: float | None = None  # adapt the learning rate to it; None: off
    critic_first: int = 0  # iterations that leave the actor alone, after `train.init_from`
    normalize_observation: bool = True
    popart: bool = False  # normalise the value targets of every objective

    def __post_init__(self) -> None:
        batch = self.num_envs * self.num_steps
        ok = batch % self.minibatch_size == 0
        expected = f"a divisor of num_envs * num_steps = {batch}"
        require(ok, "ppo.minibatch_size", expected, self.minibatch_size)
        require(0 <= self.discount < 1, "ppo.discount", "in [0, 1)", self.discount)
        require(0 <= self.gae_lambda <= 1, "ppo.gae_lambda", "in [0, 1]", self.gae_lambda)
        scale = self.critic_rate_scale
        require(scale > 0, "ppo.critic_rate_scale", "more than 0", scale)
        for name in ("learning_rate", "action_std", "std_scale"):
            ends = getattr(self, name)
            require(len(ends) == 2, f"ppo.{name}", "two values: first and last stage", ends)
        ok = min(self.std_scale) > 0
        require(ok, "ppo.std_scale", "two values of more than 0", self.std_scale)


@dataclasses.dataclass(frozen=True)
class TrainConfig:
    """The run: length, where it writes, how often it logs and saves."""

    total_steps: int = 100_000_000  # control steps (samples) of the whole run
    log_every: int = 1  # iterations between log lines
    save_every_s: float = 300.0  # wall time between checkpoints
    keep: int = 2  # learner checkpoints kept
    tensorboard: bool = False  # extra: tensorboard
    init_from: str | None = None  # a checkpoint whose policy starts the run
    # also its critic, optimiser, curriculum and which starts are learned: the same task goes on
    # with another number of simulations or on another engine; `ppo.critic_first` is not needed
    init_learner: bool = False

    def __post_init__(self) -> None:
        require(self.total_steps > 0, "train.total_steps", "more than 0", self.total_steps)
        require(self.keep >= 1, "train.keep", "at least 1", self.keep)
        ok = self.init_from is not None or not self.init_learner
        require(ok, "train.init_learner", "train.init_from, whose learner it means", "none")
