"""The error before and after adding the missing effect, beside the clean twin and the noise floor."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from glove_jobs import Row
from intervals import bootstrap
from repair_answer import error_after

mpl.use("Agg")
import matplotlib.pyplot as plt

BEFORE, AFTER, TWIN, FLOOR = "#d9822b", "#1d6cab", "#3f9c6b", "#555555"
WIDTH = 0.26


def draw_error_fall(rows: Sequence[Row], title: str, path: Path) -> None:
    """Write ``path`` with its ending: three bars for each effect, with 95 % intervals of the means."""
    learned = [(glove, answer) for glove, answer in rows if "after_deg" in answer]
    effects = list(dict.fromkeys(glove.truth for glove, _ in learned))
    figure, axes = plt.subplots(figsize=(max(0.85 * len(effects) + 2.5, 7.5), 5.0), constrained_layout=True)
    for place, effect in enumerate(effects):
        some = [answer for glove, answer in learned if glove.truth == effect]
        bars = (
            ([answer["before_deg"] for answer in some], BEFORE, "before"),
            ([error_after(answer) for answer in some], AFTER, "after adding the effect"),
            ([answer["twin_deg"] for answer in some], TWIN, "clean twin (same glove and noise, no effect)"),
        )
        for number, (values, colour, label) in enumerate(bars):
            x, mean = place + (number - 1) * WIDTH, float(np.mean(values))
            low, high = bootstrap(values)
            axes.bar(x, mean, WIDTH, color=colour, label=None if place else label)
            axes.errorbar(x, mean, [[mean - low], [high - mean]], color="black", linewidth=0.8, capsize=2)
            axes.text(x, high + 0.03, f"{mean:.2f}", ha="center", va="bottom", fontsize=6.5, rotation=90)
        floor = float(np.mean([answer["floor_deg"] for answer in some]))
        label = "" if place else "noise floor of the glove"
        axes.hlines(floor, place - 1.6 * WIDTH, place + 1.6 * WIDTH, FLOOR, "dashed", label=label)
    axes.set_xticks(range(len(effects)), effects, rotation=40, ha="right", rotation_mode="anchor", fontsize=9)
    axes.set_ylabel("RMSE on takes left out, degrees\n(affected joints; mean over gloves, 95 % interval)")
    axes.set_xlabel("effect that was missing")
    axes.set_ylim(0, axes.get_ylim()[1] * 1.12)
    axes.set_title(title, fontsize=11, loc="left")
    axes.legend(fontsize=8, frameon=False, ncols=2)
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=130)
    plt.close(figure)
