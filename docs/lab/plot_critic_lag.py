"""Draw critic_lag.csv: mean total reward and explained variance after training on from a policy.

python docs/lab/plot_critic_lag.py
"""

from __future__ import annotations

import csv
from collections import defaultdict
from pathlib import Path

import matplotlib.pyplot as plt

FOLDER = Path(__file__).parent
COLOURS = {"tied": "tab:red", "own": "tab:blue"}
STYLES = {"32": "--", "128": "-"}


def main() -> None:
    """Write critic_lag.png."""
    runs = defaultdict(list)
    with (FOLDER / "critic_lag.csv").open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            runs[row["rollout_steps"], row["critic"], row["seed"]].append(row)
    figure, axes = plt.subplots(1, 2, figsize=(10, 3.6))
    for (steps, critic, seed), rows in runs.items():
        samples = [float(row["samples"]) / 1e6 for row in rows]
        label = f"{steps} steps, critic {critic}" if seed == "0" else None
        look = {"color": COLOURS[critic], "linestyle": STYLES[steps], "label": label}
        for axis, name in zip(axes, ("reward_total", "explained_variance"), strict=True):
            axis.plot(samples, [float(row[name]) for row in rows], **look)
    for axis, name in zip(axes, ("mean total reward", "explained variance"), strict=True):
        axis.set(xlabel="million samples after the warm critic", title=name)
        axis.grid(alpha=0.3)
    axes[0].legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(FOLDER / "critic_lag.png", dpi=110)


if __name__ == "__main__":
    main()
