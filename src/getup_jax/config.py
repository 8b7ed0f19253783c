"""Every setting, its default and its meaning; YAML files hold only differences.

Sub-configs that are None are switched off, and the switch is decided when the step is
traced. `load_config` is in `settings.py`.
"""

from __future__ import annotations

import dataclasses
from dataclasses import field
from typing import Any


class ConfigError(ValueError):
    """A setting is unknown, of the wrong type, or impossible; the text names its key."""


def _require(ok: bool, key: str, expected: str, got: object) -> None:
    if not ok:
        raise ConfigError(f"{key}: expected {expected}, got {got!r}")


@dataclasses.dataclass(frozen=True)
class PhysicsConfig:
    """The simulator: engine, rate and servo."""

    engine: str = "auto"  # auto | native | mjx | mjx-warp; auto: native on a CPU, mjx elsewhere
    character: str = "humanoid49"  # assets/NAME.xml, or a path to an MJCF file
    control_hz: int = 30  # policy rate
    substeps: int = 2  # physics steps in one control period
    solver: str = "auto"  # newton | cg | pgs; auto: pgs on native, newton on MJX, which has no pgs
    iterations: int = 10  # solver iterations at most
    gain_scale: float = 1.5  # times the stiffness and damping of the MJCF file
    torque_scale: float = 1.0  # times the torque limits of the MJCF file
    armature: float = 0.1  # kg m^2, added to every hinge
    damping: float = 1.0  # Nms/rad of every hinge; all that a servo at its torque limit has
    threads: int = 0  # native: worker threads; 0: every CPU this process may use

    def __post_init__(self) -> None:
        engines = ("auto", "native", "mjx", "mjx-warp")
        _require(self.engine in engines, "physics.engine", f"one of {engines}", self.engine)
        solvers = ("auto", "newton", "cg", "pgs")
        _require(self.solver in solvers, "physics.solver", f"one of {solvers}", self.solver)
        mjx_pgs = self.engine.startswith("mjx") and self.solver == "pgs"
        expected = "auto, newton or cg, since MJX has no PGS"
        _require(not mjx_pgs, "physics.solver", expected, self.solver)
        for name in ("control_hz", "substeps", "iterations", "gain_scale", "torque_scale"):
            _require(getattr(self, name) > 0, f"physics.{name}", "more than 0", getattr(self, name))
        for name in ("armature", "damping"):
            _require(getattr(self, name) >= 0, f"physics.{name}", "at least 0", getattr(self, name))
        _require(self.threads >= 0, "physics.threads", "at least 0", self.threads)


@dataclasses.dataclass(frozen=True)
class MotionConfig:
    """Which motions give the start poses, the curves and the pose prior's data.

    A source that ends in .yaml is a curve file: a style without a motion, see curve_file.py.
    """

    source: tuple[str, ...] = ("authored",)  # `authored`, `deepmimic`, folders or files
    curves: tuple[str, ...] = ()  # names of the get-ups to train on; empty: all that are found
    mirror: bool = True  # double the pose data by mirroring
    augment_poses: int = 20_000  # poses that the authored motions are varied into for the prior
    augment_noise_rad: float = 0.05  # standard deviation of the joint noise in them


@dataclasses.dataclass(frozen=True)
class PriorConfig:
    """The conditional pose VAE."""

    conditional: bool = True  # False: the standard pose VAE, for the ablation
    latent_size: int = 16
    hidden_sizes: tuple[int, ...] = (256, 256)
    beta: float = 1e-6  # weight of the KL term
    learning_rate: float = 1e-4
    last_rate: float = 1.0  # share of it at the end, reached along a half cosine; 1: constant
    weight_decay: float = 0.0  # AdamW's, decoupled from the gradient; 0: Adam
    input_noise: float = 0.0  # on the encoder's input, in standard deviations of each hinge
    epochs: int = 100
    batch_size: int = 128
    min_updates: int = 20_000  # small pose sets get more epochs, until this many updates
    holdout: float = 0.1  # share of the poses kept for the report
    seed: int = 0

    def __post_init__(self) -> None:
        _require(0 < self.holdout < 1, "prior.holdout", "between 0 and 1", self.holdout)
        _require(0 <= self.last_rate <= 1, "prior.last_rate", "between 0 and 1", self.last_rate)
        for name in ("weight_decay", "input_noise"):
            _require(getattr(self, name) >= 0, f"prior.{name}", "at least 0", getattr(self, name))
        for name in ("latent_size", "learning_rate", "epochs", "batch_size"):
            _require(getattr(self, name) > 0, f"prior.{name}", "more than 0", getattr(self, name))


@dataclasses.dataclass(frozen=True)
class TaskConfig:
    """The get-up task: episodes, starts, early ends and the action."""

    stand_time_s: float = 3.0  # standing phase after the curve's end
    lookahead_s: tuple[float, ...] = (0.0, 0.1, 0.2, 0.3)  # when the curve targets are seen
    filter: float = 0.2  # share of the new action in the filtered one
    offset_scale: float = 1.0  # rad, PD offset of a filtered action of 1
    offset_limit_rad: float = 10.0  # c of the naturalness reward (equation 3)
    target_margin_rad: float = 0.5  # how far past a joint limit a PD target may lie
    terminate_reward: float = 0.1  # early end below this task reward ...
    terminate_after_s: float = 0.3  # ... or with the head on the floor, for this long
    head_clearance_m: float = 0.02  # the head is on the floor below this gap
    stand_start: float = 0.3  # share of episodes that start standing
    clip_start: float = 0.0  # share that starts along the reference clip, or one that fits
    # folder of getup-search, or `authored`, the shipped one; clip starts, if any, are at its states
    paths: str | None = None
    path_share: float = 0.6  # share of the clip starts that are, where there are states
    short_share: float = 0.0  # share of the lying and clip starts whose episodes are cut short ...
    short_s: float = 1.5  # ... after this long: more tries of what comes next for the same steps
    assist: float = (
        0.0  # share of the weight that a helping hand lifts at most, until starts succeed
    )
    assist_share: float = 0.5  # share of the lying and clip starts with the hand; needs focus
    curve_match_rad: float = 0.52  # largest gap between a curve's and a pose's torso angles
    focus: float = 0.0  # 0: starts are drawn evenly; towards 1: at the frontier of what is learned
    start_noise_rad: float = 0.0  # joint noise of the start poses
    pool_size: int = 2048  # start states made once
    settle_s: float = 0.5  # lying starts rest this long before the pool keeps them

    def __post_init__(self) -> None:
        share = self.stand_start + self.clip_start
        _require(0 <= share <= 1, "task.stand_start + task.clip_start", "between 0 and 1", share)
        _require(0 <= self.focus < 1, "task.focus", "at least 0 and less than 1", self.focus)
        _require(0 <= self.short_share < 1, "task.short_share", "0 to below 1", self.short_share)
        _require(self.assist >= 0, "task.assist", "at least 0", self.assist)
        ok = self.assist == 0 or self.focus > 0
        _require(ok, "task.focus", "more than 0 where task.assist is", self.focus)
        ok = 0 <= self.assist_share < 1
        _require(ok, "task.assist_share", "at least 0 and less than 1", self.assist_share)
        _require(self.short_s > 0, "task.short_s", "more than 0", self.short_s)
        _require(0 <= self.path_share <= 1, "task.path_share", "between 0 and 1", self.path_share)
        _require(0 < self.filter <= 1, "task.filter", "more than 0 and at most 1", self.filter)
        now = self.lookahead_s[:1] == (0.0,)
        _require(now, "task.lookahead_s", "times that start with 0, the present", self.lookahead_s)
        _require(self.pool_size > 0, "task.pool_size", "more than 0", self.pool_size)


@dataclasses.dataclass(frozen=True)
class TerrainConfig:
    """Irregular ground in four regions: flat, easy, medium and hard [P 3.2, 5.4].

    Half of each irregular region is rough, and half has even slopes in all directions.
    """

    seed: int = 0  # another seed is another ground of the same kind
    region_size_m: float = 48.0  # side of a region, a square
    border_m: float = 4.0  # flat ground around the regions
    grid_step_m: float = 0.5  # between two heights of the field
    tile_m: float = 1.0  # side of a tile of the rough ground
    rough_m: tuple[float, ...] = (0.06, 0.13, 0.2)  # its corners move up or down by at most this
    slope_deg: tuple[float, ...] = (10.0, 20.0, 30.0)  # steepest slope of easy, medium, hard
    slope_block_m: float = 12.0  # diameter of a hill or hollow
    drops: int = 5000  # rag-dolls dropped on the irregular regions for lying starts
    curriculum: str = "success"  # what opens the next region: success | schedule | none (all open)
    unlock_successes: int = 200  # success: this many in the newest region
    schedule_steps: int = 20_000_000  # schedule: control steps a region

    def __post_init__(self) -> None:
        for name in ("region_size_m", "grid_step_m", "tile_m", "slope_block_m"):
            _require(getattr(self, name) > 0, f"terrain.{name}", "more than 0", getattr(self, name))
        for name in ("unlock_successes", "schedule_steps", "drops"):
            _require(getattr(self, name) > 0, f"terrain.{name}", "more than 0", getattr(self, name))
        for name in ("rough_m", "slope_deg"):
            values = getattr(self, name)
            ok = len(values) == 3 and 0 <= values[0] <= values[1] <= values[2]
            expected = "three values of at least 0 that do not fall: easy, medium, hard"
            _require(ok, f"terrain.{name}", expected, values)
        ok = max(self.slope_deg) <= 60
        _require(ok, "terrain.slope_deg", "at most 60 degrees", self.slope_deg)
        kinds = ("success", "schedule", "none")
        ok = self.curriculum in kinds
        _require(ok, "terrain.curriculum", f"one of {kinds}", self.curriculum)
        self._check_sizes()

    def _check_sizes(self) -> None:
        _require(self.border_m >= 2, "terrain.border_m", "at least 2 m", self.border_m)
        ok = self.grid_step_m >= 0.5
        expected = "at least 0.5 m, since collisions with a finer field are slow"
        _require(ok, "terrain.grid_step_m", expected, self.grid_step_m)
        ok = self.slope_block_m >= 8
        expected = "at least 8 m, so that a lying body has room on one slope"
        _require(ok, "terrain.slope_block_m", expected, self.slope_block_m)
        ok = self.region_size_m >= 2 * self.slope_block_m
        expected = f"at least 2 x terrain.slope_block_m = {2 * self.slope_block_m:g} m"
        _require(ok, "terrain.region_size_m", expected, self.region_size_m)
        pairs = (
            ("region_size_m", 2 * self.slope_block_m, "2 x terrain.slope_block_m"),
            ("region_size_m", 2 * self.tile_m, "2 x terrain.tile_m"),
            ("slope_block_m", 2 * self.grid_step_m, "2 x terrain.grid_step_m"),
            ("tile_m", self.grid_step_m, "terrain.grid_step_m"),
            ("border_m", self.grid_step_m, "terrain.grid_step_m"),
        )
        for name, unit, text in pairs:
            value = getattr(self, name)
            ok = abs(value / unit - round(value / unit)) < 1e-6 and value >= unit
            _require(ok, f"terrain.{name}", f"a multiple of {text} = {unit:g} m", value)


@dataclasses.dataclass(frozen=True)
class NetworkConfig:
    """Actor and critic: separate multilayer perceptrons."""

    hidden_sizes: tuple[int, ...] = (256, 256)
    activation: str = "relu"  # relu | tanh | elu | silu | relu6
    gru_size: int = 256  # GRU in front of both, where the task observes a history of frames
    # first std of actions that the actor gives for each state; None: ppo.action_std for all
    initial_std: float | None = None
    std_range: float = 2.0  # how far the actor may move it either way, in e-folds

    def __post_init__(self) -> None:
        _require(self.gru_size > 0, "network.gru_size", "more than 0", self.gru_size)
        std = self.initial_std
        _require(std is None or std > 0, "network.initial_std", "more than 0, or null", std)
        ok = self.std_range >= 0
        _require(ok, "network.std_range", "at least 0", self.std_range)
        names = ("relu", "tanh", "elu", "silu", "relu6")
        ok = self.activation in names
        _require(ok, "network.activation", f"one of {names}", self.activation)


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
    stages: int = 5  # equal stages of the whole run, for both schedules
    target_clip_fraction: float | None = None  # adapt the learning rate to it; None: off
    critic_first: int = 0  # iterations that leave the actor alone, after `train.init_from`
    normalize_observation: bool = True
    popart: bool = False  # normalise the value targets of every objective

    def __post_init__(self) -> None:
        batch = self.num_envs * self.num_steps
        ok = batch % self.minibatch_size == 0
        expected = f"a divisor of num_envs * num_steps = {batch}"
        _require(ok, "ppo.minibatch_size", expected, self.minibatch_size)
        _require(0 <= self.discount < 1, "ppo.discount", "in [0, 1)", self.discount)
        _require(0 <= self.gae_lambda <= 1, "ppo.gae_lambda", "in [0, 1]", self.gae_lambda)
        scale = self.critic_rate_scale
        _require(scale > 0, "ppo.critic_rate_scale", "more than 0", scale)
        for name in ("learning_rate", "action_std"):
            ends = getattr(self, name)
            _require(len(ends) == 2, f"ppo.{name}", "two values: first and last stage", ends)


@dataclasses.dataclass(frozen=True)
class GroupConfig:
    """Links that imitate clips of their own, judged by a discriminator of their own [C 4.1]."""

    links: tuple[str, ...] = ()  # names of links, or of presets: upper, lower, arms, rest, full
    clips: tuple[str, ...] = ()  # names of authored clips, or motion files
    frame: str = "heading"  # heading: of the newest root | root: the root's own in every frame
    history: int = 3  # n_i of equation 3; a window has 2 frames more
    speed: tuple[float, ...] = (1.0, 1.0)  # range of the clips' pace, drawn for each window

    def __post_init__(self) -> None:
        frames = ("heading", "root")
        _require(self.frame in frames, "composite.groups.*.frame", f"one of {frames}", self.frame)
        ok = 0 <= self.history <= 3
        _require(ok, "composite.groups.*.history", "0 to 3, which the actor sees", self.history)
        ok = len(self.speed) == 2 and 0 < self.speed[0] <= self.speed[1]
        _require(ok, "composite.groups.*.speed", "0 < slowest <= fastest", self.speed)


@dataclasses.dataclass(frozen=True)
class DiscriminatorConfig:
    """One ensemble a group: a GRU over the window, dense layers, many heads [C 4.2]."""

    gru_size: int = 256
    hidden_sizes: tuple[int, ...] = (256, 128)
    heads: int = 32  # N of equation 2
    gradient_penalty: float = 10.0  # lambda of equation 2
    # whose gradient is held at 1: sum, that of all heads together, as in the authors' release: the
    # mean of N heads then changes by at most 1 / N a unit of distance | head, each, as equation 2
    penalty_of: str = "sum"
    learning_rate: float = 1e-5
    minibatch_size: int = 256
    share: float = 1.0  # of a rollout's windows that an update learns from, drawn at random
    # features (m, and numbers of quaternions) that vary by less are not blown up to a std of 1:
    # clips hold many links still, and any noise of the actions would tell the two kinds apart
    least_std: float = 0.0
    # windows of earlier rollouts that are kept, and make up half of the simulated ones; 0: none
    memory: int = 0

    def __post_init__(self) -> None:
        ok = 0 < self.share <= 1
        _require(ok, "composite.discriminator.share", "more than 0, at most 1", self.share)
        _require(
            self.memory >= 0,
            "composite.discriminator.memory",
            "0, or a number of windows",
            self.memory,
        )
        ok = self.least_std >= 0
        _require(ok, "composite.discriminator.least_std", "at least 0", self.least_std)
        for name in ("gru_size", "heads", "learning_rate", "minibatch_size"):
            value = getattr(self, name)
            _require(value > 0, f"composite.discriminator.{name}", "more than 0", value)
        kinds = ("sum", "head")
        ok = self.penalty_of in kinds
        key = "composite.discriminator.penalty_of"
        _require(ok, key, f"one of {kinds}", self.penalty_of)
        ok = self.gradient_penalty >= 0
        key = "composite.discriminator.gradient_penalty"
        _require(ok, key, "at least 0", self.gradient_penalty)


@dataclasses.dataclass(frozen=True)
class CompositeConfig:
    """Several objectives, each with a critic of its own [C].

    With `task: composite` it replaces the get-up task by composite motion; with `task: getup` the
    reward terms of getting up, and discriminators for its style, are the objectives.
    """

    task: str = "composite"  # composite | getup
    # getup: reward terms that are objectives: total (all of them multiplied), task, height,
    # orientation, velocity, posture, natural
    terms: tuple[str, ...] = ("total",)
    groups: dict[str, GroupConfig] = field(default_factory=dict)
    shared_links: tuple[str, ...] = ()  # links that several groups may have
    free_links: tuple[str, ...] = ()  # links that need not be in any group
    # goal tasks by name with their settings, such as {target_location: {speed: [1.2, 1.5]}}
    goals: dict[str, dict[str, Any]] = field(default_factory=dict)
    weights: dict[str, float] = field(default_factory=dict)  # of objectives; empty: all the same
    multi_objective: bool = True  # False: one critic for the weighted sum of all rewards
    discriminator: DiscriminatorConfig = field(default_factory=DiscriminatorConfig)
    meta: str | None = None  # a composite policy whose actions this one weights and adds to [C 5]
    start_group: str | None = None  # episodes start along its clips; None: the last group's
    start_mixed: bool = False  # and with the other groups' hinges from their own clips
    episode_s: float = 10.0
    # training episodes are cut at random, on average after this long: more samples near the clips,
    # where an episode starts and a policy learns to go on with a motion; None: only at episode_s
    cut_s: float | None = None
    end_reward: float = -1.0  # of every objective in the step that ends an episode early
    fall_height_m: float = 0.15  # a joint centre below it, but for the feet's, is a fall
    action_scale: float = 1.0  # times the range below, moved by an action of 1
    # range: of a hinge, its whole range | clips: as much as the clips move it, and a little more
    action_range: str = "range"
    # pose of action 0; clips: of each hinge the mean over its group's clips | neutral
    action_centre: str = "clips"

    def __post_init__(self) -> None:
        tasks = ("composite", "getup")
        _require(self.task in tasks, "composite.task", f"one of {tasks}", self.task)
        if self.task == "getup":
            self._check_getup()
        else:
            _require(bool(self.groups), "composite.groups", "at least one group", self.groups)
        _require(self.episode_s > 0, "composite.episode_s", "more than 0", self.episode_s)
        _require(self.action_scale > 0, "composite.action_scale", "more than 0", self.action_scale)
        _require(
            self.cut_s is None or self.cut_s > 0,
            "composite.cut_s",
            "more than 0, or null",
            self.cut_s,
        )
        centres, centre = ("clips", "neutral"), self.action_centre
        ok = centre in centres
        _require(ok, "composite.action_centre", f"one of {centres}", centre)
        ranges = ("range", "clips")
        ok = self.action_range in ranges
        _require(ok, "composite.action_range", f"one of {ranges}", self.action_range)
        start = self.start_group
        names = tuple(self.groups)
        ok = start is None or start in names
        _require(ok, "composite.start_group", f"one of {names}, or null", start)

    def _check_getup(self) -> None:
        known = ("total", "task", "height", "orientation", "velocity", "posture", "natural")
        ok = set(self.terms) <= set(known) and len(set(self.terms)) == len(self.terms) > 0
        _require(ok, "composite.terms", f"some of {known}", self.terms)
        for name, empty in (("goals", {}), ("meta", None)):
            value = getattr(self, name)
            _require(value == empty, f"composite.{name}", "none while getting up", value)


@dataclasses.dataclass(frozen=True)
class TrainConfig:
    """The run: length, where it writes, how often it logs and saves."""

    total_steps: int = 100_000_000  # control steps (samples) of the whole run
    log_every: int = 1  # iterations between log lines
    save_every_s: float = 300.0  # wall time between checkpoints
    keep: int = 2  # learner checkpoints kept
    tensorboard: bool = False  # extra: tensorboard
    init_from: str | None = None  # a checkpoint whose policy starts the run

    def __post_init__(self) -> None:
        _require(self.total_steps > 0, "train.total_steps", "more than 0", self.total_steps)
        _require(self.keep >= 1, "train.keep", "at least 1", self.keep)


@dataclasses.dataclass(frozen=True)
class Config:
    """One run. `getup-train FILE section.key=value ...` overrides any of it."""

    seed: int = 0
    physics: PhysicsConfig = field(default_factory=PhysicsConfig)
    motion: MotionConfig = field(default_factory=MotionConfig)
    # None: no pose prior, the action is the servo target and no offset is unnatural
    prior: PriorConfig | None = field(default_factory=PriorConfig)
    task: TaskConfig = field(default_factory=TaskConfig)
    terrain: TerrainConfig | None = None  # None: a flat plane
    composite: CompositeConfig | None = None  # None: the get-up task
    network: NetworkConfig = field(default_factory=NetworkConfig)
    ppo: PPOConfig = field(default_factory=PPOConfig)
    train: TrainConfig = field(default_factory=TrainConfig)

    @property
    def composite_motion(self) -> bool:
        """Whether the task is composite motion; False: getting up."""
        return self.composite is not None and self.composite.task == "composite"

    def __post_init__(self) -> None:
        if self.composite is None or not self.composite.groups:
            return
        flat = "null with composite motion or discriminators, which are on a plane"
        ok = self.terrain is None or not self.composite.groups
        _require(ok, "terrain", flat, self.terrain)
        batch = self.ppo.num_envs * self.ppo.num_steps
        size = self.composite.discriminator.minibatch_size
        seen = round(batch * self.composite.discriminator.share)
        expected = f"a divisor of ppo.num_envs * ppo.num_steps = {batch}, times share = {seen}"
        _require(seen % size == 0, "composite.discriminator.minibatch_size", expected, size)
