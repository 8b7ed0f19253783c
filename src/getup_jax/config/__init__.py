"""Every setting, its default and its meaning; YAML files hold only differences.

Every number has its range beside its default (`ranges.number`), and all are checked before
anything is built; relations between settings are in `__post_init__`. Sub-configs that are None
are switched off, and the switch is decided when the step is traced. `load_config` is in
`config/load.py`.
"""

from __future__ import annotations

import dataclasses
from dataclasses import field

from getup_jax.config.check import ConfigError, require
from getup_jax.config.composite import CompositeConfig, DiscriminatorConfig, GroupConfig
from getup_jax.config.curriculum import CurriculumConfig
from getup_jax.config.learning import NetworkConfig, PPOConfig, TrainConfig
from getup_jax.config.ranges import LAST_SEED, check_numbers, number
from getup_jax.config.simulation import MotionConfig, PhysicsConfig, PriorConfig, TerrainConfig
from getup_jax.config.task import TaskConfig

__all__ = [
    "CompositeConfig",
    "Config",
    "ConfigError",
    "CurriculumConfig",
    "DiscriminatorConfig",
    "GroupConfig",
    "MotionConfig",
    "NetworkConfig",
    "PPOConfig",
    "PhysicsConfig",
    "PriorConfig",
    "TaskConfig",
    "TerrainConfig",
    "TrainConfig",
]


@dataclasses.dataclass(frozen=True)
class Config:
    """One run. `getup-train FILE section.key=value ...` overrides any of it."""

    seed: int = number(0, least=0, most=LAST_SEED)  # of everything that is drawn
    physics: PhysicsConfig = field(default_factory=PhysicsConfig)
    motion: MotionConfig = field(default_factory=MotionConfig)
    # None: no pose prior, the action is the servo target and no offset is unnatural
    prior: PriorConfig | None = field(default_factory=PriorConfig)
    task: TaskConfig = field(default_factory=TaskConfig)
    curriculum: CurriculumConfig | None = None  # None: nothing helps to train
    terrain: TerrainConfig | None = None  # None: a flat plane
    composite: CompositeConfig | None = None  # None: the get-up task
    network: NetworkConfig = field(default_factory=NetworkConfig)
    ppo: PPOConfig = field(default_factory=PPOConfig)
    train: TrainConfig = field(default_factory=TrainConfig)

    @property
    def composite_motion(self) -> bool:
        """Whether the task is composite motion; False: getting up."""
        return self.composite is not None

    @property
    def training_aids(self) -> CurriculumConfig:
        """The curriculum; one that does nothing where there is none."""
        return self.curriculum or CurriculumConfig()

    def __post_init__(self) -> None:
        check_numbers(self, "")
        scale, default = self.ppo.std_scale, PPOConfig.std_scale
        ok = scale == default or self.network.initial_std is not None
        expected = f"{default} where network.initial_std is null; ppo.action_std sets the noise"
        require(ok, "ppo.std_scale", expected, scale)
        unlike = self.network.mirror and self.prior is not None and not self.prior.mirror
        expected = "false where prior.mirror is false, as its latents have no mirror images"
        require(self.composite_motion or not unlike, "network.mirror", expected, True)
        share = self.task.stand_start + self.training_aids.reference_start
        expected = "at most 1"
        require(share <= 1, "task.stand_start + curriculum.reference_start", expected, share)
        ok = self.terrain is not None or self.train.irregular_from is None
        expected = "null on a flat plane; set terrain.curriculum, say"
        require(ok, "train.irregular_from", expected, self.train.irregular_from)
        if self.composite is None:
            return
        expected = "null with composite motion, which is on a plane"
        require(self.terrain is None, "terrain", expected, self.terrain)
        expected = "null with composite motion, which has none"
        require(self.curriculum is None, "curriculum", expected, "one")
        batch = self.ppo.num_envs * self.ppo.num_steps
        size = self.composite.discriminator.minibatch_size
        seen = round(batch * self.composite.discriminator.share)
        expected = f"a divisor of ppo.num_envs * ppo.num_steps = {batch}, times share = {seen}"
        require(seen % size == 0, "composite.discriminator.minibatch_size", expected, size)
