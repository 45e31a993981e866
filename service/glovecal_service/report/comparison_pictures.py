"""The pictures of a comparison over all rotations: errors beside floors, dependences, models side by side."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes

from glovecal_models.comparison.compare import Comparison, RotationErrors
from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.comparison.where_it_fails import RotationFindings, WhereItFails
from glovecal_service.report.diagnosis_pictures import KEY, draw_heat
from glovecal_service.report.drawing import FLOOR, MODEL, QUIET, legend_above, svg

MOST_COLUMNS = 32
LEADING = ("angle", "speed", "direction", "time in take", "time since power-on", "wearing")
"""Columns that every heat map starts with; context and sensors follow."""
COLOURS = ("#1d6cab", "#3f9c6b", "#8d5fa8", "#c2453d", "#6b6b6b", "#17a2a8", "#a8790f", "#d16ba5")
MARKERS = "osD^vP*X"
ALL = "all rotations"


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
        axes.set_xlim(0, None)
        legend_above(axes)

    return svg(draw, 9, 1.5 + 0.24 * len(items))


def heat_map(where: WhereItFails) -> str:
    """Rotations by columns: share of the error that each column explains; significant ones marked."""
    cells = {item.rotation: _cells(item) for item in where.rotations}
    sizes: dict[str, float] = {}
    for of_rotation in cells.values():
        for name, (explained, _) in of_rotation.items():
            sizes[name] = max(sizes.get(name, 0.0), explained)
    columns = sorted(sizes, key=lambda name: (*_place(name), -sizes[name]))[:MOST_COLUMNS]
    values = np.full((len(where.rotations), len(columns)), np.nan)
    significant = np.zeros(values.shape, dtype=bool)
    for row, item in enumerate(where.rotations):
        for column, name in enumerate(columns):
            explained, significant[row, column] = cells[item.rotation].get(name, (np.nan, False))
            values[row, column] = explained / max(item.rmse_deg, 1e-12)

    def draw(axes: Axes) -> None:
        draw_heat(axes, values, significant, 1, "share of the rotation's RMSE")
        axes.set_xticks(range(len(columns)), columns, rotation=60, ha="right")
        axes.set_yticks(range(len(where.rotations)), [item.rotation for item in where.rotations])

    return svg(draw, 2.5 + 0.32 * len(columns), 2.2 + 0.24 * len(where.rotations))


def _place(name: str) -> tuple[int, bool]:
    """Where a column stands in the heat map."""
    return (LEADING.index(name) if name in LEADING else len(LEADING), not name.startswith("context "))


def _cells(item: RotationFindings) -> dict[str, tuple[float, bool]]:
    """For each column of the heat map: degrees explained, and whether that is significant."""
    cells = {one.covariate: (one.explained_deg, item.is_structure(one)) for one in item.dependences}
    if item.wearings is not None:
        cells["wearing"] = (item.wearings.spread_deg, item.wearings.is_significant)
    return cells


def floors_sentence(where: WhereItFails) -> str:
    """Which rotations have no more to gain."""
    done = [item.rotation for item in where.rotations if item.is_at_floor]
    if not done:
        return "No rotation is at its noise floor."
    return f"{len(done)} of {len(where.rotations)} rotations are at their noise floor: {', '.join(done)}."


def heat_sentence(where: WhereItFails) -> str:
    """The largest significant dependence."""
    marked = [(item, one) for item in where.rotations for one in item.structure]
    if not marked:
        return f"{KEY} No recorded column explains a significant part of any error."
    item, one = max(marked, key=lambda pair: pair[1].explained_deg)
    return (
        f"{KEY} The largest: {one.phrase}, RMS contribution {one.explained_deg:.1f} of "
        f"{item.rmse_deg:.1f} degrees at {item.rotation}."
    )


def side_by_side(models: Mapping[str, Comparison]) -> tuple[str, str]:
    """``models``: for each name its numbers. One row a rotation, and what is seen."""
    rotations = dict.fromkeys(name for one in models.values() for name in one.rotations)
    rows = [ALL, *sorted(rotations, key=lambda rotation: -_worst(models, rotation))][::-1]

    def draw(axes: Axes) -> None:
        for place, rotation in enumerate(rows):
            floor = smallest_floor(models, rotation)
            if floor is not None:
                width, label = floor.high_deg - floor.low_deg, "noise floor, 95 % interval"
                axes.barh(
                    place, width, left=floor.low_deg, height=0.7, color=FLOOR, alpha=0.45,
                    label=label if rotation == rows[-1] else None,
                )  # fmt: skip
        for number, (name, comparison) in enumerate(models.items()):
            known = [(_errors(comparison, rotation), place) for place, rotation in enumerate(rows)]
            axes.plot(
                [one.rmse_deg for one, _ in known if one is not None],
                [place for one, place in known if one is not None],
                MARKERS[number % len(MARKERS)], color=COLOURS[number % len(COLOURS)], label=name,
            )  # fmt: skip
        axes.set_yticks(range(len(rows)), rows)
        axes.grid(axis="y", color=QUIET, alpha=0.4, linewidth=0.8)
        axes.set_axisbelow(True)
        axes.set(xlabel="error (RMSE), degrees", xlim=(0, None))
        legend_above(axes)

    return svg(draw, 9, 1.6 + 0.26 * len(rows)), _compared_sentence(models, list(rotations))


def smallest_floor(models: Mapping[str, Comparison], rotation: str) -> NoiseFloor | None:
    """Of the models' own floors, since a model that jitters more has a higher one; lower bounds come last."""
    every = (_errors(one, rotation) for one in models.values())
    floors = [one.floor for one in every if one is not None and one.floor is not None]
    return min(floors, key=lambda floor: (floor.is_lower_bound, floor.floor_deg), default=None)


def _errors(comparison: Comparison, rotation: str) -> RotationErrors | None:
    return comparison.overall if rotation == ALL else comparison.rotations.get(rotation)


def _worst(models: Mapping[str, Comparison], rotation: str) -> float:
    every = (_errors(one, rotation) for one in models.values())
    return max(one.rmse_deg for one in every if one is not None)


def _compared_sentence(models: Mapping[str, Comparison], rotations: list[str]) -> str:
    names = list(models)
    first, *others = sorted(names, key=lambda name: models[name].overall.rmse_deg)
    bests = [_best(models, rotation) for rotation in rotations]
    floor = smallest_floor(models, ALL)
    rest = ", ".join(f"{models[name].overall.rmse_deg:.2f} for {name}" for name in others)
    least = "at least " if floor is not None and floor.is_lower_bound else ""
    beside = f"; smallest noise floor: {least}{floor.floor_deg:.2f}" if floor is not None else ""
    return (
        f"{first} has the smallest error, {models[first].overall.rmse_deg:.2f} degrees over all rotations "
        f"({rest}){beside}. It is best in {bests.count(first)} of {len(rotations)} rotations."
    )


def _best(models: Mapping[str, Comparison], rotation: str) -> str:
    errors = {name: _errors(one, rotation) for name, one in models.items()}
    return min(errors, key=lambda name: np.inf if (one := errors[name]) is None else one.rmse_deg)
