"""The bench's figures as one picture: three rows of bars on logarithmic axes, ours first."""

# pyright: reportMissingImports=false, reportAttributeAccessIssue=false, reportArgumentType=false

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt

OURS, THEIRS = "#1b6ca8", "#b0b7bf"


def draw(result: dict[str, Any], path: Path) -> None:
    """Write ``path`` (PNG)."""
    figure, axes = plt.subplots(3, 1, figsize=(9, 9), constrained_layout=True)
    frames = result["frames"]
    joint = [(row["who"], row["cpu_s"]) for row in result["one_joint"]]
    _bars(axes[0], joint, f"Training one joint, N = {frames}, D = 3", "CPU s")
    glove = result["whole_glove"]
    bars = [("Glovecal LMC-GPR", glove["cpu_s"])]
    if "gpboost_fitc_cpu_s" in glove:
        bars.append(("GPBoost FITC", glove["gpboost_fitc_cpu_s"]))
    bars += [(f"{row['who']} (estimated)", row["cpu_s"]) for row in glove["exact_peers"]]
    _bars(axes[1], bars, "Training a whole glove, 22 rotations", "CPU s")
    frame = [(row["who"], row["median_ms"]) for row in result["one_frame"]]
    _bars(axes[2], frame, "One frame, whole glove, mean and variance", "ms")
    figure.savefig(path, dpi=130)
    plt.close(figure)


def _bars(axis: Any, entries: list[tuple[str, float]], title: str, unit: str) -> None:
    names, values = zip(*entries, strict=True)
    colours = [OURS if name.startswith("Glovecal") else THEIRS for name in names]
    axis.barh(range(len(names)), values, color=colours)
    axis.set_yticks(range(len(names)), names)
    axis.invert_yaxis()
    axis.set_xscale("log")
    axis.set_xlim(min(values) / 3.0, max(values) * 6.0)
    axis.set_title(title, loc="left", fontsize=11)
    axis.set_xlabel(unit)
    for position, value in enumerate(values):
        axis.text(
            value * 1.1, position, f"{value:.3g} {unit} ({value / values[0]:.3g} x)", va="center", fontsize=8
        )
    axis.spines[["top", "right"]].set_visible(False)
