"""The pictures of a diagnosis: what each candidate saves beside its decoy, and on which rotations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from glovecal_service.report.drawing import DECOY, FLOOR, MODEL, QUIET, svg

Candidates = Sequence[Mapping[str, Any]]


def saved_beside_decoys(candidates: Candidates) -> tuple[str, str]:
    """Degrees that each candidate takes off the error, its decoy's below; and who passes."""
    shown = list(candidates)[::-1]
    saved = [_saved(item, "rmse_after_deg") for item in shown]
    by_decoy = [_saved(item, "rmse_decoy_deg") for item in shown]

    def draw(axes: Axes) -> None:
        rows = np.arange(len(shown))
        colours = [MODEL if item.get("passes") else QUIET for item in shown]
        axes.barh(rows + 0.2, saved, height=0.38, color=colours)
        axes.barh(rows - 0.2, by_decoy, height=0.38, color=DECOY, alpha=0.7)
        axes.barh([0], [0], color=MODEL, label="effect, beyond decoy and chance")
        axes.barh([0], [0], color=QUIET, label="effect, no more than chance")
        axes.barh([0], [0], color=DECOY, alpha=0.7, label="its decoy")
        axes.axvline(0, color=QUIET, linewidth=0.8)
        axes.set_yticks(rows, [item["effect"] for item in shown])
        axes.set_xlabel("error saved on takes left out, degrees")
        axes.legend(frameon=False, loc="lower right", fontsize=8)

    return svg(draw, 9, 1.3 + 0.3 * len(shown)), _saved_sentence(candidates)


def heat_of_candidates(candidates: Candidates) -> tuple[str, str] | None:
    """Candidates by rotations: share of the squared error saved beyond the decoy; None without shares."""
    shown = [item for item in candidates if isinstance(item.get("saved_share"), Mapping)]
    rotations = list(dict.fromkeys(name for item in shown for name in item["saved_share"]))
    if not shown or not rotations:
        return None
    values = np.array([[_beyond(item, name) for name in rotations] for item in shown])
    dots = [
        (rotations.index(name), row)
        for row, item in enumerate(shown)
        for name in item.get("where") or ()
        if name in rotations
    ]

    def draw(axes: Axes) -> None:
        image = axes.imshow(100 * values, cmap="Blues", aspect="auto", vmin=0, vmax=100)
        if dots:
            axes.plot(*zip(*dots, strict=True), ".", color=FLOOR, markersize=8)
        axes.set_xticks(range(len(rotations)), rotations, rotation=60, ha="right")
        axes.set_yticks(range(len(shown)), [item["effect"] for item in shown])
        axes.figure.colorbar(image, ax=axes, label="% of squared error", shrink=0.8)

    row, column = np.unravel_index(int(np.argmax(values)), values.shape)
    largest = values[row, column]
    sentence = (
        f"What each effect saves beyond its decoy; a dot marks what is beyond chance. The largest: "
        f"{shown[row]['effect']} on {rotations[column]}, {100 * largest:.0f} % of the squared error."
        if largest > 0
        else "No effect saves more than its decoy on any rotation."
    )
    return svg(draw, 3.6 + 0.36 * len(rotations), 1.6 + 0.27 * len(shown)), sentence


def errors_beside_floors(rotations: Mapping[str, Mapping[str, Any]]) -> tuple[str, str]:
    """A bar for each rotation's error, its noise floor marked; and which is farthest above."""
    names = sorted(rotations, key=lambda name: rotations[name].get("rmse_deg") or 0.0)
    errors = [rotations[name].get("rmse_deg") or 0.0 for name in names]
    floors = [rotations[name].get("noise_floor_deg") for name in names]
    known = [(row, floor) for row, floor in enumerate(floors) if floor is not None]

    def draw(axes: Axes) -> None:
        axes.barh(np.arange(len(names)), errors, color=MODEL, label="error (RMSE)")
        if known:
            rows, values = zip(*known, strict=True)
            axes.plot(values, rows, "|", color=FLOOR, markersize=11, markeredgewidth=3, label="noise floor")
        axes.set_yticks(range(len(names)), names)
        axes.set_xlabel("degrees, on takes left out")
        axes.legend(frameon=False, loc="lower right", fontsize=8)

    above = [(errors[row] - floor, row) for row, floor in known]
    if not above:
        sentence = "The noise floors are not known from these takes."
    else:
        most, row = max(above)
        sentence = (
            f"Most is left at {names[row]}: {errors[row]:.2f} degrees, {most:.2f} above its noise floor."
            if most > 0
            else "No rotation is above its noise floor."
        )
    return svg(draw, 9, 1.2 + 0.24 * len(names)), sentence


def _saved(item: Mapping[str, Any], name: str) -> float:
    before, after = item.get("rmse_before_deg"), item.get(name)
    return 0.0 if before is None or after is None else float(before - after)


def _beyond(item: Mapping[str, Any], rotation: str) -> float:
    decoy = item.get("decoy_saved_share")
    of_decoy = decoy.get(rotation) if isinstance(decoy, Mapping) else None
    return max((item["saved_share"].get(rotation) or 0.0) - max(of_decoy or 0.0, 0.0), 0.0)


def _saved_sentence(candidates: Candidates) -> str:
    passing = [item for item in candidates if item.get("passes")]
    tried = f"{len(candidates)} effects were tried"
    if not passing:
        return f"{tried}; none saves more than its decoy and chance do."
    first, *others = passing
    rest = f"; {', '.join(item['effect'] for item in others)} passed too" if others else "; no other passed"
    return (
        f"{tried}. {first['effect']} takes {_saved(first, 'rmse_after_deg'):.2f} degrees off the error, its "
        f"decoy {_saved(first, 'rmse_decoy_deg'):.2f}{rest}."
    )
