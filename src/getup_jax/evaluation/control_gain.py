"""Control gain: how much of what an edit of a curve asks for is done.

Variants of a curve are followed from the same start as the curve itself. At the same times, while
both episodes rise, for every feature:

    asked = target of the variant - target of the curve
    done = feature of the body that follows the variant - feature of the one on the curve
    gain = sum(asked done) / sum(asked^2)

Gain and correlation are 1 where every edit is followed exactly. A body lags what it follows, so
both are also given at the lag at which the correlation is highest.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from rich.table import Table

from getup_jax.envs.getup.build import BuiltTask
from getup_jax.envs.getup.episode import LYING
from getup_jax.evaluation.rollout import Progress, run_episodes
from getup_jax.evaluation.scenario import Plan
from getup_jax.motion.getup.curves import NAMES
from getup_jax.rl.learner import Learner
from getup_jax.runtime.console import as_text

# Standard deviation of a control point's move (m, rad, rad), each of its own. The curves between
# them move by .05 m, 6 and 7 degrees (rms): a spline is a mean of points, and the ends stay.
EDIT_STD = (0.08, math.radians(10.0), math.radians(12.0))
EDITED = slice(2, 8)  # points; those before are how the body lies, the last one is how it stands
_LOWEST, _HIGHEST = (0.05, 0.0, 0.0), (1.5, math.pi, math.pi)
LONGEST_LAG_S = 0.5
_BOOTSTRAPS = 2000


@dataclasses.dataclass(frozen=True, eq=False)
class Responses:
    """What M edits asked for and what was done, step by step."""

    asked: np.ndarray  # [T, M, 3] m, rad, rad
    done: np.ndarray  # [T, M, 3]
    used: np.ndarray  # [T, M] bool; a step while variant and curve rise
    curves: int  # G, whose variants they are, M / G of each


@dataclasses.dataclass(frozen=True)
class FeatureGain:
    """Of one feature; NaN where nothing was asked."""

    gain: float
    correlation: float
    gain_low: float  # 95 % interval of the gain, curves drawn anew (bootstrap); NaN for one curve
    gain_high: float
    lag_s: float  # at which the correlation is highest
    gain_at_lag: float
    correlation_at_lag: float
    asked_rms: float  # m or rad
    done_rms: float


@dataclasses.dataclass(frozen=True)
class ControlGain:
    """The measure of one policy."""

    features: dict[str, FeatureGain]  # height, side_angle, front_angle
    edits: int  # variants of each curve
    curves: int
    success: float  # share of the variants; NaN where nobody looked


def edited(points: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """Variants [count, 9, 3] of a curve's control points [9, 3].

    They stay within what bodies do, but for points of the curve that are beyond it.
    """
    variants = np.repeat(points[None], count, axis=0)
    shape = variants[:, EDITED].shape
    variants[:, EDITED] += rng.normal(0.0, EDIT_STD, shape)
    lowest, highest = np.minimum(points, _LOWEST), np.maximum(points, _HIGHEST)
    return np.clip(variants, lowest, highest)


def edit_plan(task: BuiltTask, count: int, seed: int, styles: Sequence[int] | None = None) -> Plan:
    """Each style and then `count` variants of it, all from the style's first lying start.

    styles: their numbers; None: all of the task. A style's variants do not depend on the others.
    On irregular ground the starts are in the first region, which is flat.
    """
    styles = range(len(task.getups)) if styles is None else styles
    parts = []
    for style in styles:
        own, rng = task.getups[style].points, np.random.default_rng([seed, style])
        parts += [own[None], edited(own, count, rng)]
    points = np.concatenate(parts)
    episodes = len(points)
    return Plan(
        kind=LYING,
        getup=np.repeat(np.asarray(styles, np.int32), count + 1),
        row=np.zeros(episodes, np.int32),
        duration_scale=np.ones(episodes, np.float32),
        impulse=np.zeros((episodes, 3)),
        region=None if task.environment.terrain is None else np.zeros(episodes, np.int32),
        points=points.astype(np.float32),
    )


def measure(
    task: BuiltTask, learner: Learner, policy: Any, plan: Plan, progress: Progress
) -> ControlGain:
    """Run a plan of `edit_plan` and measure what its edits did."""
    trace = run_episodes(task, learner, policy, plan, progress).trace
    rises = trace.running & (trace.time < trace.duration)
    responses = of_values(trace.features, trace.target, rises, curves_of(plan))
    success = _by_curve(trace.success, responses.curves)[:, :, 1:].any(axis=0).mean()
    return gain_of(responses, task, float(success))


def gain_of(responses: Responses, task: BuiltTask, success: float) -> ControlGain:
    """The measure of responses in the task; success: share of the variants."""
    edits = responses.used.shape[1] // responses.curves
    gains = control_gain(responses, task.environment.engine.control_dt)
    return ControlGain(gains, edits, responses.curves, success)


def curves_of(plan: Plan) -> int:
    """How many curves a plan of `edit_plan` has."""
    return len(np.unique(plan.getup))


def of_values(
    features: np.ndarray, target: np.ndarray, rises: np.ndarray, curves: int
) -> Responses:
    """The responses in features and targets [T, N, 3] of the N episodes of an `edit_plan`.

    rises [T, N]: whether the step belongs to the episode and to its rise.
    """

    def change(values: np.ndarray) -> np.ndarray:
        values = _by_curve(values, curves)
        found = values[:, :, 1:] - values[:, :, :1]
        return found.reshape(len(found), -1, len(NAMES))

    rises = _by_curve(rises, curves)
    used = rises[:, :, 1:] & rises[:, :, :1]
    return Responses(change(target), change(features), used.reshape(len(used), -1), curves)


def control_gain(responses: Responses, control_dt: float) -> dict[str, FeatureGain]:
    """The gain of each feature."""
    lags = range(round(LONGEST_LAG_S / control_dt) + 1)
    found = {}
    for index, name in enumerate(NAMES):
        pairs = [_pairs(responses, index, lag) for lag in lags]
        results = [regress(asked, done) for asked, done in pairs]
        correlations = [correlation for _, correlation in results]
        best = 0 if np.isnan(correlations).all() else int(np.nanargmax(correlations))
        asked, done = pairs[0]
        found[name] = FeatureGain(
            *results[0],
            *interval(responses, index),
            lag_s=best * control_dt,
            gain_at_lag=results[best][0],
            correlation_at_lag=results[best][1],
            asked_rms=_rms(asked),
            done_rms=_rms(done),
        )
    return found


def regress(asked: np.ndarray, done: np.ndarray) -> tuple[float, float]:
    """Slope through the origin and correlation of done [N] on asked [N]; NaN without any."""
    power = float(np.sum(asked**2))
    if power == 0 or np.ptp(asked) == 0 or np.ptp(done) == 0:
        return (float(np.sum(asked * done)) / power if power else math.nan), math.nan
    return float(np.sum(asked * done)) / power, float(np.corrcoef(asked, done)[0, 1])


def interval(responses: Responses, feature: int) -> tuple[float, float]:
    """95 % interval of a gain by bootstrap: all edits of a curve come or stay away together."""
    if responses.curves < 2:
        return math.nan, math.nan
    asked = np.where(responses.used, responses.asked[..., feature], 0.0)
    done = np.where(responses.used, responses.done[..., feature], 0.0)
    product, power = (
        x.reshape(len(x), responses.curves, -1).sum(axis=(0, 2)) for x in (asked * done, asked**2)
    )
    drawn = np.random.default_rng(0).integers(len(power), size=(_BOOTSTRAPS, len(power)))
    total = power[drawn].sum(axis=1)
    known = total > 0
    if not known.any():
        return math.nan, math.nan
    gains = product[drawn].sum(axis=1)[known] / total[known]
    low, high = np.quantile(gains, [0.025, 0.975])
    return float(low), float(high)


def table(found: Mapping[str, ControlGain]) -> str:
    """The gains of every name, such as a policy and its bound, feature by feature."""
    columns = "gain", "95 %", "correlation", "lag s", "gain, correlation", "asked", "done"
    view = Table("of the edits of", "feature", *columns, "success")
    for name, result in found.items():
        for feature, row in result.features.items():
            scale, unit = (1.0, "m") if feature == NAMES[0] else (180.0 / math.pi, "deg")
            view.add_row(
                name,
                feature.replace("_", " "),
                f"{row.gain:.2f}",
                f"{row.gain_low:.2f} - {row.gain_high:.2f}",
                f"{row.correlation:.2f}",
                f"{row.lag_s:.2f}",
                f"{row.gain_at_lag:.2f}, {row.correlation_at_lag:.2f}",
                f"{scale * row.asked_rms:.3g} {unit}",
                f"{scale * row.done_rms:.3g} {unit}",
                "-" if math.isnan(result.success) else f"{result.success:.0%}",
            )
    return as_text(view, width=200)


def to_json(found: ControlGain) -> dict[str, Any]:
    """{feature: {gain, correlation, ...}} of plain numbers; NaN becomes null."""
    return {
        name: {
            key: None if math.isnan(value) else value
            for key, value in dataclasses.asdict(row).items()
        }
        for name, row in found.features.items()
    }


def _by_curve(values: np.ndarray, curves: int) -> np.ndarray:
    """[T, N, ...] of a plan of `edit_plan` as [T, G, 1 + edits, ...]."""
    return values.reshape(len(values), curves, -1, *values.shape[2:])


def _pairs(responses: Responses, feature: int, lag: int) -> tuple[np.ndarray, np.ndarray]:
    """What was asked and what was done `lag` steps later, in all steps where both are used."""
    steps = max(len(responses.used) - lag, 0)
    used = responses.used[:steps] & responses.used[lag:]
    return responses.asked[:steps][used][:, feature], responses.done[lag:][used][:, feature]


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else math.nan
