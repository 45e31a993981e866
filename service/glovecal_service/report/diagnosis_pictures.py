"""The pictures of a diagnosis: what each candidate saves beside its control, and on which rotations.

Blue is significant, grey is not, in every picture.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from glovecal_service.report.drawing import (
    CONTROL,
    FLOOR,
    GREY_SHARES,
    MODEL,
    QUIET,
    SHARES,
    legend_above,
    svg,
)

Candidates = Sequence[Mapping[str, Any]]
KEY = "Blue with a dot: significant; grey: not."


def saved_beside_controls(candidates: Candidates) -> tuple[str, str]:
    """Degrees by which each candidate reduces the error, its control's below; and which are significant."""
    shown = list(candidates)[::-1]
    saved = [_saved(item, "rmse_after_deg") for item in shown]
    by_control = [_saved(item, "rmse_control_deg") for item in shown]

    def draw(axes: Axes) -> None:
        rows = np.arange(len(shown))
        colours = [MODEL if item.get("passes") else QUIET for item in shown]
        axes.barh(rows + 0.2, saved, height=0.38, color=colours)
        axes.barh(rows - 0.2, by_control, height=0.38, color=CONTROL, alpha=0.7)
        axes.barh([0], [0], color=MODEL, label="effect, significant")
        axes.barh([0], [0], color=QUIET, label="effect, not significant")
        axes.barh([0], [0], color=CONTROL, alpha=0.7, label="its control")
        axes.axvline(0, color=QUIET, linewidth=0.8)
        axes.set_yticks(rows, [item["effect"] for item in shown])
        axes.set_xlabel("error of the sensors reduced by, degrees, on held-out takes")
        legend_above(axes)

    return svg(draw, 9, 1.5 + 0.34 * len(shown)), _saved_sentence(candidates)


def heat_of_candidates(candidates: Candidates) -> tuple[str, str] | None:
    """Candidates by rotations: share of the squared error saved beyond the control; None without shares."""
    shown = [item for item in candidates if isinstance(item.get("saved_share"), Mapping)]
    rotations = list(dict.fromkeys(name for item in shown for name in item["saved_share"]))
    if not shown or not rotations:
        return None
    values = np.array([[_beyond(item, name) for name in rotations] for item in shown])
    significant = np.array([[name in (item.get("where") or ()) for name in rotations] for item in shown])

    def draw(axes: Axes) -> None:
        draw_heat(axes, 100 * values, significant, 100, "% of squared error")
        axes.set_xticks(range(len(rotations)), rotations, rotation=60, ha="right")
        axes.set_yticks(range(len(shown)), [item["effect"] for item in shown])

    of_significant = np.where(significant, values, 0.0)
    row, column = np.unravel_index(int(np.argmax(of_significant)), values.shape)
    largest = of_significant[row, column]
    sentence = (
        f"What each effect saves beyond its control. {KEY} The largest: {shown[row]['effect']} on "
        f"{rotations[column]}, {100 * largest:.0f} % of the squared error."
        if largest > 0
        else f"What each effect saves beyond its control. {KEY} No effect is significant on any rotation."
    )
    return svg(draw, 3.6 + 0.36 * len(rotations), 1.6 + 0.27 * len(shown)), sentence


def draw_heat(axes: Axes, values: np.ndarray, significant: np.ndarray, highest: float, label: str) -> None:
    """Cells (R, C) from 0 to ``highest``, NaN for none: blue with a dot where significant, else grey."""
    grey = np.where(significant, np.nan, values)
    axes.imshow(grey, cmap=GREY_SHARES, aspect="auto", vmin=0, vmax=highest, interpolation="none")
    blue = np.where(significant, values, np.nan)
    image = axes.imshow(blue, cmap=SHARES, aspect="auto", vmin=0, vmax=highest, interpolation="none")
    rows, columns = np.nonzero(significant)
    axes.plot(columns, rows, ".", color=FLOOR, markersize=6)
    axes.figure.colorbar(image, ax=axes, label=label, shrink=0.8)


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
        axes.set_xlabel("smoothed error on held-out takes, degrees")
        axes.set_xlim(0, None)
        legend_above(axes)

    above = [(errors[row] - floor, row) for row, floor in known]
    if not above:
        sentence = "The noise floors of these takes are unknown."
    else:
        most, row = max(above)
        sentence = (
            f"Largest possible improvement at {names[row]}: {errors[row]:.2f} degrees, {most:.2f} above its "
            "noise floor."
            if most > 0
            else "No rotation is above its noise floor."
        )
    return svg(draw, 9, 1.2 + 0.24 * len(names)), sentence


def _saved(item: Mapping[str, Any], name: str) -> float:
    before, after = item.get("rmse_before_deg"), item.get(name)
    return 0.0 if before is None or after is None else float(before - after)


def _beyond(item: Mapping[str, Any], rotation: str) -> float:
    control = item.get("control_saved_share")
    of_control = control.get(rotation) if isinstance(control, Mapping) else None
    return max((item["saved_share"].get(rotation) or 0.0) - max(of_control or 0.0, 0.0), 0.0)


def _saved_sentence(candidates: Candidates) -> str:
    significant = [item for item in candidates if item.get("passes")]
    tried = f"{len(candidates)} effects were tried"
    if not significant:
        return f"{tried}; none beats its control significantly."
    first, *others = significant
    rest = f"; also significant: {', '.join(item['effect'] for item in others)}" if others else ""
    return (
        f"{tried}. {first['effect']} reduces the error of the sensors by "
        f"{_saved(first, 'rmse_after_deg'):.2f} degrees (control: "
        f"{_saved(first, 'rmse_control_deg'):.2f}){rest}."
    )
