"""Several models beside one another: the error of each rotation against the noise floor."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes

from glovecal_models.comparison.compare import Comparison, RotationErrors
from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_service.report.drawing import FLOOR, svg

COLOURS = ("#1d6cab", "#3f9c6b", "#8d5fa8", "#c2453d", "#6b6b6b", "#17a2a8", "#a8790f", "#d16ba5")
MARKERS = "osD^vP*X"
ALL = "all rotations"


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
        axes.grid(axis="y", color="#e8eaed", linewidth=0.8)
        axes.set_axisbelow(True)
        axes.set(xlabel="error (RMSE), degrees", xlim=(0, None))
        axes.legend(frameon=False, loc="lower left", bbox_to_anchor=(0, 1), ncols=3)

    return svg(draw, 9, 1.6 + 0.26 * len(rows)), _sentence(models, list(rotations))


def smallest_floor(models: Mapping[str, Comparison], rotation: str) -> NoiseFloor | None:
    """Of the models' own floors, since a model that jitters more has a higher one; lower bounds come last."""
    every = (_errors(one, rotation) for one in models.values())
    floors = [one.floor for one in every if one is not None and one.floor is not None]
    return min(floors, key=lambda floor: (floor.is_lower_bound, floor.floor_deg), default=None)


def _errors(comparison: Comparison, rotation: str) -> RotationErrors | None:
    return comparison.over_all if rotation == ALL else comparison.rotations.get(rotation)


def _worst(models: Mapping[str, Comparison], rotation: str) -> float:
    every = (_errors(one, rotation) for one in models.values())
    return max(one.rmse_deg for one in every if one is not None)


def _sentence(models: Mapping[str, Comparison], rotations: list[str]) -> str:
    names = list(models)
    first, *others = sorted(names, key=lambda name: models[name].over_all.rmse_deg)
    bests = [_best(models, rotation) for rotation in rotations]
    floor = smallest_floor(models, ALL)
    rest = ", ".join(f"{models[name].over_all.rmse_deg:.2f} for {name}" for name in others)
    least = "at least " if floor is not None and floor.is_lower_bound else ""
    beside = f"; their smallest noise floor is {least}{floor.floor_deg:.2f}" if floor is not None else ""
    return (
        f"{first} has the smallest error, {models[first].over_all.rmse_deg:.2f} degrees over all rotations "
        f"({rest}){beside}. It is the best in {bests.count(first)} of {len(rotations)} rotations."
    )


def _best(models: Mapping[str, Comparison], rotation: str) -> str:
    errors = {name: _errors(one, rotation) for name, one in models.items()}
    return min(errors, key=lambda name: np.inf if (one := errors[name]) is None else one.rmse_deg)
