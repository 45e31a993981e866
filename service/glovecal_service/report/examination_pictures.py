"""The pictures of an independence examination: the matrix of shares, and the deviations beside the rule."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from glovecal_service.report.drawing import FLOOR, MODEL, QUIET, svg

MOST_SHOWN_PCT = 50.0
NOT_MOVED = "#f1f2f4"


def matrix(found: Mapping[str, Any]) -> tuple[str, str]:
    """Rows: rotations kept still; columns: affecting sensors; each cell the two deviations in per cent."""
    rows, columns = found["rotations"], found["sensors"]
    values = np.full((len(rows), len(columns)), np.nan)
    for row, item in enumerate(rows):
        for share in item["affecting"]:
            values[row, columns.index(share["sensor"])] = share["std_pct"]

    def draw(axes: Axes) -> None:
        image = axes.imshow(values, cmap="Blues", aspect="auto", vmin=0, vmax=MOST_SHOWN_PCT)
        for row, item in enumerate(rows):
            _row(axes, row, item, columns)
        axes.set_xticks(range(len(columns)), columns, rotation=60, ha="right")
        axes.set_yticks(range(len(rows)), [item["rotation"] for item in rows])
        axes.set_xticks(np.arange(len(columns) + 1) - 0.5, minor=True)
        axes.set_yticks(np.arange(len(rows) + 1) - 0.5, minor=True)
        axes.grid(which="minor", color=QUIET, linewidth=0.5)
        axes.tick_params(which="minor", length=0)
        axes.set(xlabel="affecting sensor", ylabel="rotation kept still")
        axes.figure.colorbar(image, ax=axes, label="standard deviation, % of range", shrink=0.8)

    return svg(draw, 2.8 + 0.46 * len(columns), 2.1 + 0.4 * len(rows)), _matrix_sentence(rows)


def deviations(found: Mapping[str, Any]) -> tuple[str, str]:
    """Standard and largest deviation of each still rotation, the rule's limits marked."""
    rows, rule = found["rotations"][::-1], found["rule"]

    def draw(axes: Axes) -> None:
        places = np.arange(len(rows))
        axes.barh(places + 0.2, [item["std_pct"] for item in rows], height=0.38, color=MODEL)
        axes.barh(places - 0.2, [item["max_pct"] for item in rows], height=0.38, color=QUIET)
        axes.barh([0], [0], color=MODEL, label="standard deviation")
        axes.barh([0], [0], color=QUIET, label="largest deviation")
        axes.axvline(rule["std_pct"], color=FLOOR, linewidth=1.2, label=f"{rule['std_pct']:g} % standard")
        axes.axvline(
            rule["max_pct"], color=FLOOR, linewidth=1.2, linestyle=":", label=f"{rule['max_pct']:g} % largest"
        )
        axes.set_yticks(places, [item["rotation"] for item in rows])
        axes.set_xlabel("% of the active range, while the rotation is kept still")
        axes.legend(frameon=False, ncols=4, loc="lower left", bbox_to_anchor=(0, 1), fontsize=8)

    coupled = [item["rotation"] for item in found["rotations"] if item["is_coupled"]]
    alone = [item["rotation"] for item in found["rotations"] if not item["is_coupled"]]
    sentence = (
        f"Cross-coupled: {', '.join(coupled) or 'none'}. Independent: {', '.join(alone) or 'none'}. "
        "From either limit on a sensor is cross-coupled (Wang & Neff 2013)."
    )
    return svg(draw, 9, 1.4 + 0.3 * len(rows)), sentence


def _row(axes: Axes, row: int, item: Mapping[str, Any], columns: Sequence[str]) -> None:
    for name in item["not_moved"]:
        _fill(axes, row, columns.index(name), NOT_MOVED, None)
    _fill(axes, row, columns.index(item["sensor"]), "white", "///")
    for share in item["affecting"]:
        column = columns.index(share["sensor"])
        dark = share["std_pct"] > 0.6 * MOST_SHOWN_PCT
        text = f"{share['std_pct']:.0f} | {share['max_pct']:.0f}"
        colour = "white" if dark else "#1a1a1a"
        axes.text(column, row, text, ha="center", va="center", fontsize=6.5, color=colour)
        if share["affects"] == "yes":
            axes.plot(column + 0.36, row - 0.33, "o", color=FLOOR, markersize=4)
        elif share["affects"] == "undecided":
            axes.text(
                column + 0.36,
                row - 0.3,
                "?",
                ha="center",
                va="center",
                fontsize=9,
                color=FLOOR,
                weight="bold",
            )


def _fill(axes: Axes, row: int, column: int, colour: str, hatch: str | None) -> None:
    axes.fill_between(
        [column - 0.5, column + 0.5], row - 0.5, row + 0.5, facecolor=colour, edgecolor=QUIET, hatch=hatch,
        linewidth=0,
    )  # fmt: skip


def _matrix_sentence(rows: Sequence[Mapping[str, Any]]) -> str:
    legend = (
        "Standard | largest deviation of each affecting sensor's own, % of the still sensor's active range. "
        "A dot: affects by the 5 % and 12 % rule; ?: undecided; grey: did not move by itself, so nothing is "
        "known; white: adds nothing; hatched: the rotation's own sensor."
    )
    shares = [
        (share["affects"] == "yes", share["std_pct"], share, item)
        for item in rows
        for share in item["affecting"]
    ]
    if not shares:
        return f"No sensor affects another. {legend}"
    _, size, share, item = max(shares, key=lambda one: one[:2])
    return (
        f"Most is done by {share['sensor']}: it alone moves the reading of {item['sensor']} by {size:.0f} % "
        f"of its range ({share['std_low']:.0f} to {share['std_high']:.0f}), at most "
        f"{share['max_pct']:.0f} %. {legend}"
    )
