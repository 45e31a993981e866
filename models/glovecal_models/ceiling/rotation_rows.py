"""What the black box is asked of one rotation: rows of recorded columns, and the errors beside them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.calibration.prepared_takes import PreparedTakes
from glovecal_models.ceiling.recorded_columns import (
    GROUPS,
    MOST_ROWS,
    ROW_EVERY,
    TakeColumns,
    exchanged,
    own_averages,
    smoothed_error,
)


@dataclass(frozen=True)
class RotationRows:
    """Of one rotation, all takes after one another; only rows where it was measured."""

    groups: dict[str, np.ndarray]
    others: dict[str, np.ndarray]
    """The same columns with the rows of other takes."""
    symmetric: np.ndarray
    target: np.ndarray
    take: np.ndarray
    mean_square: float
    """Of the error at the frames, not smoothed."""
    own: tuple[int, ...]

    @classmethod
    def of(
        cls, columns: Sequence[TakeColumns], prepared: PreparedTakes, errors: Sequence[np.ndarray],
        order: Sequence[int], own: tuple[int, ...],
    ) -> RotationRows | None:  # fmt: skip
        smooth = [
            smoothed_error(item.time_s, take, error)
            for item, take, error in zip(columns, prepared.takes, errors, strict=True)
        ]
        measured = sum(int(np.isfinite(values).sum()) for values in smooth)
        step = max(ROW_EVERY, -(-measured // MOST_ROWS))
        index = [np.flatnonzero(np.isfinite(values))[::step] for values in smooth]
        if min(len(rows) for rows in index) == 0:
            return None
        swapped = {name: exchanged([item.groups[name] for item in columns], order) for name in GROUPS}

        def stacked(parts: Sequence[np.ndarray]) -> np.ndarray:
            return np.concatenate([values[rows] for values, rows in zip(parts, index, strict=True)])

        every = np.concatenate(errors)
        return cls(
            {name: stacked([item.groups[name] for item in columns]) for name in GROUPS},
            {name: stacked(swapped[name]) for name in GROUPS},
            stacked([item.symmetric_history for item in columns]),
            stacked(smooth),
            np.concatenate([np.full(len(rows), number) for number, rows in enumerate(index)]),
            float(np.nanmean(every**2)),
            own,
        )


def products_of(rows: RotationRows) -> tuple[list[tuple[int, ...]], list[tuple[int, ...]]]:
    """Places of columns to be multiplied: powers of the own readings, which know no past; and these with the
    products of a reading and its running averages, a memory that depends on the bend."""
    sensors = rows.groups["readings"].shape[1]
    averages = own_averages(rows.own, sensors)
    powers = [(sensor,) * power for sensor in rows.own for power in (2, 3)]
    remembered = [
        (*(sensor,) * power, sensors + place)
        for sensor, places in averages.items()
        for place in places
        for power in (1, 2)
    ]
    return powers, [*powers, *remembered]


def joined(groups: Mapping[str, np.ndarray]) -> np.ndarray:
    """Side by side, readings first."""
    return np.column_stack(list(groups.values()))
