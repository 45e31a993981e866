"""The pictures of a comparison."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from glovecal_models.comparison.residuals import Residuals, TakeResiduals
from glovecal_models.comparison.stretches import windows
from glovecal_models.comparison.structure import Dependence
from glovecal_models.comparison.where_it_fails import (
    RotationFindings,
    WhereItFails,
)
from glovecal_service.report.drawing import FLOOR, MEASURED, MODEL, QUIET, figure_svg, svg

MOST_POINTS = 1500
MOST_COLUMNS = 32
LEADING = ("angle", "speed", "direction", "time in take", "time since power-on", "wearing")
"""Columns that every heat map starts with; context and sensors follow."""
SHOWN_S = 12.0


def errors_and_floors(where: WhereItFails) -> str:
    """A bar for each rotation's error, its noise floor marked."""
    items = where.rotations[::-1]

    def draw(axes: Axes) -> None:
        rows = np.arange(len(items))
        axes.barh(rows, [item.rmse_deg for item in items], color=MODEL, label="error (RMSE)")
        known = [(row, item.floor) for row, item in zip(rows, items, strict=True) if item.floor is not None]
        for number, (row, floor) in enumerate(known):
            axes.plot([floor.low_deg, floor.high_deg], [row, row], color=FLOOR, linewidth=2)
            label = "noise floor, 95 % interval" if number == 0 else None
            axes.plot(floor.floor_deg, row, "|", color=FLOOR, markersize=11, markeredgewidth=3, label=label)
        axes.set_yticks(rows, [item.rotation for item in items])
        axes.set_xlabel("degrees")
        axes.legend(frameon=False, loc="lower right")

    return svg(draw, 9, 1.2 + 0.24 * len(items))


def heat_map(where: WhereItFails) -> str:
    """Rotations by columns: what share of the error each column explains; a dot where it is no noise."""
    cells = {item.rotation: _cells(item) for item in where.rotations}
    sizes: dict[str, float] = {}
    for of_rotation in cells.values():
        for name, (explained, _) in of_rotation.items():
            sizes[name] = max(sizes.get(name, 0.0), explained)
    columns = sorted(sizes, key=lambda name: (*_place(name), -sizes[name]))[:MOST_COLUMNS]
    values = np.full((len(where.rotations), len(columns)), np.nan)
    dots = []
    for row, item in enumerate(where.rotations):
        for column, name in enumerate(columns):
            explained, is_no_noise = cells[item.rotation].get(name, (np.nan, False))
            values[row, column] = explained / max(item.rmse_deg, 1e-12)
            if is_no_noise:
                dots.append((column, row))

    def draw(axes: Axes) -> None:
        image = axes.imshow(values, cmap="Blues", aspect="auto", vmin=0, vmax=1)
        if dots:
            axes.plot(*zip(*dots, strict=True), ".", color=FLOOR, markersize=7)
        axes.set_xticks(range(len(columns)), columns, rotation=60, ha="right")
        axes.set_yticks(range(len(where.rotations)), [item.rotation for item in where.rotations])
        axes.figure.colorbar(image, ax=axes, label="share of the rotation's RMSE", shrink=0.8)

    return svg(draw, 2.5 + 0.32 * len(columns), 2.2 + 0.24 * len(where.rotations))


def _place(name: str) -> tuple[int, bool]:
    """Where a column stands in the heat map."""
    return (LEADING.index(name) if name in LEADING else len(LEADING), not name.startswith("context "))


def _cells(item: RotationFindings) -> dict[str, tuple[float, bool]]:
    """For each column of the heat map: degrees explained, and whether that is no noise."""
    cells = {one.covariate: (one.explained_deg, item.is_structure(one)) for one in item.dependences}
    if item.wearings is not None:
        cells["wearing"] = (item.wearings.spread_deg, item.wearings.is_no_noise)
    return cells


def over_time(found: Residuals, rotation: str) -> tuple[str, str]:
    """Prediction with its claimed band and measurement, errors below, around the worst time; and where."""
    column = found.column(rotation)
    item, rows = _worst_window(found, column)
    time = item.take.time_s[rows] - item.take.start_s
    predicted, sd = item.predicted[rows, column], item.sd[rows, column]
    measured, error = item.measured[rows, column], item.error[rows, column]

    def draw(figure: Figure) -> None:
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
        band = (predicted - 2 * sd, predicted + 2 * sd)
        above.fill_between(time, *band, color=MODEL, alpha=0.2, linewidth=0, label="± 2 claimed sd")
        above.plot(time, predicted, color=MODEL, linewidth=1.2, label="predicted")
        above.plot(time, measured, color=MEASURED, linewidth=1.2, linestyle=":", label="measured")
        above.set_ylabel(f"{rotation}, degrees")
        above.legend(frameon=False, ncols=3, loc="lower left", bbox_to_anchor=(0, 1))
        below.fill_between(time, -2 * sd, 2 * sd, color=MODEL, alpha=0.2, linewidth=0)
        below.axhline(0, color=QUIET)
        below.plot(time, error, color=MODEL, linewidth=1)
        below.set(xlabel=f"seconds of take {item.take.name}", ylabel="error, degrees")

    known = np.isfinite(error)
    outside = float(np.mean(np.abs(error[known]) > 2 * sd[known])) if known.any() else 0.0
    sentence = (
        f"Take {item.take.name}, {time[0]:.0f} to {time[-1]:.0f} s: {100 * outside:.0f} % of the errors lie "
        "outside two claimed standard deviations; 5 % would be truthful."
    )
    return figure_svg(draw, 9, 4), sentence


def error_against(item: RotationFindings, one: Dependence) -> tuple[str, str]:
    """Mean error in bins of one column, and what it says."""
    middles = 0.5 * (one.edges[1:] + one.edges[:-1])
    unit = f", {one.unit}" if one.unit else ""

    def draw(axes: Axes) -> None:
        band = (item.bias_deg - one.chance_deg, item.bias_deg + one.chance_deg)
        axes.fill_between(middles, *band, color=QUIET, alpha=0.5, linewidth=0, label="95 % of chance")
        axes.axhline(0, color=QUIET)
        axes.plot(middles, one.mean_deg, "o-", color=MODEL)
        axes.legend(frameon=False, fontsize=8)
        axes.set(xlabel=f"{one.covariate}{unit}", ylabel=f"mean error of {item.rotation}, degrees")

    sentence = (
        f"Against {one.phrase} the mean error of {item.rotation} goes from {np.min(one.mean_deg):+.1f} to "
        f"{np.max(one.mean_deg):+.1f} degrees, {one.explained_deg:.1f} degrees in all; chance goes as far in "
        f"{100 * one.probability:.1f} % of trials: {_verdict(item, one)}."
    )
    return svg(draw, 4.4, 3), sentence


def _verdict(item: RotationFindings, one: Dependence) -> str:
    if item.is_structure(one):
        return "this is structure"
    if one.probability <= item.limits.structure_p_value:
        return f"structure, but little of {item.rmse_deg:.1f} degrees"
    return "it may be noise"


def _worst_window(found: Residuals, column: int) -> tuple[TakeResiduals, np.ndarray]:
    """The take and frames (every so many) of the worst ``SHOWN_S`` seconds of a rotation."""
    best: tuple[float, TakeResiduals, slice] | None = None
    for item in found.takes:
        time, squared = item.take.time_s, item.error[:, column] ** 2
        for rows in windows(time, SHOWN_S):
            known = squared[rows][np.isfinite(squared[rows])]
            if len(known) > 1 and (best is None or known.mean() > best[0]):
                best = (float(known.mean()), item, rows)
    if best is None:
        item = max(found.takes, key=lambda one: int(np.isfinite(one.error[:, column]).sum()))
        return item, np.arange(len(item.take.time_s))
    _, item, rows = best
    return item, np.arange(rows.start, rows.stop)[:: -(-(rows.stop - rows.start) // MOST_POINTS)]
