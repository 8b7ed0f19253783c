"""Draw keeps_learning.csv: mean total reward while shipped policies are trained on.

python docs/lab/plot_keeps_learning.py
"""

from __future__ import annotations

import csv
from collections import defaultdict
from pathlib import Path

import matplotlib.pyplot as plt

FOLDER = Path(__file__).parent
# `flat` with the learner before: before, and means around 1, 2 and 3 M steps more
BEFORE = ((0.0, 1.0, 2.0, 3.0), (0.631, 0.569, 0.516, 0.504))


def main() -> None:
    """Write keeps_learning.png."""
    runs = defaultdict(list)
    with (FOLDER / "keeps_learning.csv").open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            runs[row["policy"]].append((float(row["samples"]) / 1e6, float(row["reward_total"])))
    figure, axis = plt.subplots(figsize=(6, 3.6))
    axis.plot(*BEFORE, "o--", color="tab:red", label="flat, one optimiser for actor and critic")
    for policy, points in runs.items():
        axis.plot(*zip(*points, strict=True), label=f"{policy}, now")
    axis.set(xlabel="million samples more", ylabel="mean total reward, with noise")
    axis.grid(alpha=0.3)
    axis.legend(fontsize=8, loc="center right")
    figure.tight_layout()
    figure.savefig(FOLDER / "keeps_learning.png", dpi=110)


if __name__ == "__main__":
    main()
