"""Networks, PPO and the run."""

from __future__ import annotations

import dataclasses
import math

from getup_jax.config.check import require
from getup_jax.config.ranges import MOST_SAMPLES, check_numbers, number


@dataclasses.dataclass(frozen=True)
class NetworkConfig:
    """Actor and critic: separate multilayer perceptrons."""

    # of the dense layers of either
    hidden_sizes: tuple[int, ...] = number((256, 256), least=1, most=4096, length=(0, 8))
    activation: str = "relu"  # relu | tanh | elu | silu | relu6
    # what is done in the mirror image of a state is the mirror image of what is done in the state,
    # by construction (units come in pairs, and a layer has half of the weights); where the task has
    # a mirror image, which composite motion has not
    mirror: bool = True
    # GRU in front of both, where the task observes a history of frames
    gru_size: int = number(256, least=1, most=4096)
    # first std of actions that the actor gives for each state; None: ppo.action_std for all
    initial_std: float | None = number(None, above=0, most=10)
    # how far the actor may move it either way, in e-folds
    std_range: float = number(2.0, least=0, most=10)

    def __post_init__(self) -> None:
        check_numbers(self, "network")
        names = ("relu", "tanh", "elu", "silu", "relu6")
        ok = self.activation in names
        require(ok, "network.activation", f"one of {names}", self.activation)


@dataclasses.dataclass(frozen=True)
class PPOConfig:
    """PPO-Clip with GAE; actor and critic have an optimiser each."""

    num_envs: int = number(512, least=1, most=131_072)  # B
    num_steps: int = number(64, least=1, most=65_536)  # T
    epochs: int = number(4, least=1, most=1000)  # of the actor
    critic_epochs: int = number(4, least=1, most=1000)  # passes of the critic over a rollout
    minibatch_size: int = number(2048, least=1, most=MOST_SAMPLES)  # samples of an update
    discount: float = number(0.99, least=0, below=1)  # gamma, a control step
    # of generalised advantage estimation: less of it is less noise, and more of the critic's errors
    gae_lambda: float = number(0.95, least=0, most=1)
    # of the critic's targets; None: the same
    critic_lambda: float | None = number(None, least=0, most=1)
    clip: float = number(0.2, above=0, most=10)  # epsilon: how far the probability ratio may move
    # weight of the entropy in the loss
    entropy_coefficient: float = number(0.0, least=0, most=10)
    max_gradient_norm: float = number(0.5, above=0, most=1e6)  # of the actor
    critic_gradient_norm: float = number(0.5, above=0, most=1e6)  # of the critic
    # of the actor, first and last stage
    learning_rate: tuple[float, ...] = number((1e-4, 2e-5), least=0, most=1, length=2)
    # first and last stage
    critic_learning_rate: tuple[float, ...] = number((3e-4, 3e-4), least=0, most=1, length=2)
    # first and last stage
    action_std: tuple[float, ...] = number((0.6, 0.3), above=0, most=10, length=2)
    # times the std that the actor gives (network.initial_std), first and last stage
    std_scale: tuple[float, ...] = number((1.0, 1.0), above=0, most=10, length=2)
    # equal stages of the whole run, for all schedules
    stages: int = number(5, least=1, most=10_000)
    # adapt the actor's rate to it, below learning_rate; None: off
    target_clip_fraction: float | None = number(None, above=0, below=1)
    # iterations that leave the actor alone, after `train.init_from`
    critic_first: int = number(0, least=0, most=1_000_000)
    # samples that the moving average of the actor's weights spans, which is what is evaluated and
    # exported, and at most a tenth of the run so far; 0: the newest weights
    average_steps: float = number(1e6, least=0, most=1e12)
    normalize_observation: bool = True  # by running mean and variance
    popart: bool = False  # normalise the value targets of every objective

    def __post_init__(self) -> None:
        check_numbers(self, "ppo")
        batch = self.num_envs * self.num_steps
        expected = f"at most {MOST_SAMPLES} samples an iteration"
        require(batch <= MOST_SAMPLES, "ppo.num_envs * ppo.num_steps", expected, batch)
        ok = batch % self.minibatch_size == 0
        expected = f"a divisor of num_envs * num_steps = {batch}"
        require(ok, "ppo.minibatch_size", expected, self.minibatch_size)


@dataclasses.dataclass(frozen=True)
class TrainConfig:
    """The run: length, where it writes, how often it logs and saves."""

    # control steps (samples) of the whole run
    total_steps: int = number(100_000_000, least=1, most=10**15)
    log_every: int = number(1, least=1, most=1_000_000)  # iterations between log lines
    save_every_s: float = number(300.0, least=0, most=math.inf)  # wall time between checkpoints
    keep: int = number(2, least=1, most=1_000_000)  # learner checkpoints kept
    tensorboard: bool = False  # extra: tensorboard
    wandb: str | None = None  # project on Weights & Biases, extra: wandb; None: off
    init_from: str | None = None  # a checkpoint whose policy starts the run
    # another one, of irregular ground: it teaches there what init_from, of a plane, does not know;
    # needs network.mirror=false here if it was trained so, since what it does has no mirror image
    irregular_from: str | None = None
    # also its critic, optimiser, curriculum and which starts are learned: the same task goes on
    # with another number of simulations or on another engine; `ppo.critic_first` is not needed
    init_learner: bool = False

    def __post_init__(self) -> None:
        check_numbers(self, "train")
        ok = self.init_from is not None or not self.init_learner
        require(ok, "train.init_learner", "train.init_from, whose learner it means", "none")
        ok = self.irregular_from is None or (self.init_from is not None and not self.init_learner)
        expected = "train.init_from, of a plane, and no train.init_learner"
        require(ok, "train.irregular_from", expected, self.irregular_from)
