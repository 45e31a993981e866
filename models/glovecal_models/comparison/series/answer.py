"""One rotation over time or against a column: measured, predicted and error, few enough points to draw."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

import numpy as np

from glovecal_models.comparison.where.answer import Dependence
from glovecal_models.presentation.document import TakeNamed, answer
from glovecal_models.takes.shown_frames import shown_frames

if TYPE_CHECKING:
    from glovecal_models.comparison.dependence import Covariate
    from glovecal_models.comparison.residuals import Residuals, TakeResiduals

LINE_BREAKS_S = 1.0
"""Between two takes on the linked axis."""
FEWEST_POINTS = 20
"""Points of a take that has any."""
MOST_SERIES_POINTS = 1500


@answer
class TakeSeries:
    take: str
    name: str
    wearing: str
    trained_on: bool
    """Whether the model was trained on this take."""
    start_s: float
    """Of the first frame, by the take's clock."""
    end_s: float
    linked_s: float
    """Where the take starts on the linked axis, on which takes stand after one another, 1 s apart: linked
    time is `time_s - start_s + linked_s`."""
    frames: int
    """In the window, before some were chosen."""
    time_s: Sequence[float]
    """Of the frames chosen, by the take's clock."""
    measured_deg: Sequence[float | None]
    """Null where nothing was measured."""
    predicted_deg: Sequence[float | None]
    sd_deg: Sequence[float | None]
    """Claimed standard deviation of a measurement."""
    error_deg: Sequence[float | None]
    """Predicted minus measured."""


@answer
class Series:
    model: str
    rotation: str
    linked_s: float
    """Length of the linked axis."""
    takes: Sequence[TakeSeries]
    """All takes asked for; without points outside the window."""


def series_of(
    found: Residuals,
    rows: Sequence[TakeNamed],
    model: str,
    rotation: str,
    *,
    window_s: tuple[float, float],
    points: int,
    trained_on: Collection[str],
) -> Series:
    """Of takes as ``rows`` name them, in the order of the residuals; ``window_s`` is on the linked axis.

    ``points`` are shared out by how many frames of each take are in the window; extremes are kept.
    """
    column = found.column(rotation)
    starts, at = [], 0.0
    for item in found.takes:
        starts.append(at)
        at += item.take.duration_s + LINE_BREAKS_S
    inside = [_inside(item, start, window_s) for item, start in zip(found.takes, starts, strict=True)]
    every = max(1, sum(map(len, inside)))
    takes = []
    for item, row, start, frames in zip(found.takes, rows, starts, inside, strict=True):
        columns = np.column_stack(
            [one[frames, column] for one in (item.measured, item.predicted, item.error)]
        )
        most = max(FEWEST_POINTS, points * len(frames) // every)
        chosen = frames[shown_frames(columns, most)] if len(frames) else frames
        takes.append(
            TakeSeries(
                take=row.id,
                name=row.name,
                wearing=item.take.wearing,
                trained_on=row.id in trained_on,
                start_s=float(item.take.time_s[0]),
                end_s=float(item.take.time_s[-1]),
                linked_s=start,
                frames=len(frames),
                time_s=item.take.time_s[chosen].tolist(),
                measured_deg=_known(item.measured[chosen, column]),
                predicted_deg=_known(item.predicted[chosen, column]),
                sd_deg=_known(item.sd[chosen, column]),
                error_deg=_known(item.error[chosen, column]),
            )
        )
    return Series(model=model, rotation=rotation, linked_s=max(0.0, at - LINE_BREAKS_S), takes=takes)


def _known(values: np.ndarray) -> list[float | None]:
    return [float(value) if np.isfinite(value) else None for value in values]


def _inside(item: TakeResiduals, linked_s: float, window_s: tuple[float, float]) -> np.ndarray:
    """Frames in the window and one on either side, so that lines reach its edges."""
    time = item.take.time_s - item.take.time_s[0] + linked_s
    first, last = np.searchsorted(time, window_s[0]), np.searchsorted(time, window_s[1], side="right")
    if first >= last:
        return np.arange(0)
    return np.arange(max(0, first - 1), min(len(time), last + 1))


@answer
class RecordedColumn:
    name: str
    unit: str
    phrase: str
    """As a sentence names it."""


@answer
class ResidualColumn:
    model: str
    rotation: str
    column: RecordedColumn
    columns: Sequence[RecordedColumn]
    """All that the residual can be held against."""
    rmse_deg: float
    bias_deg: float
    dependence: Dependence | None
    """Null: the column has fewer than two values."""
    value: Sequence[float]
    """Of at most 1,500 frames, evenly chosen, in the column's unit."""
    error_deg: Sequence[float]
    """Predicted minus measured, of the same frames."""
    sentence: str


def residual_against(
    found: Residuals, model: str, rotation: str, columns: Sequence[Covariate], chosen: Covariate,
    dependence: Dependence | None,
) -> ResidualColumn:  # fmt: skip
    """``dependence``: of the rotation's error on the ``chosen`` one of ``columns``."""
    error = found.stacked("error")[:, found.column(rotation)]
    value = np.concatenate(chosen.values)
    known = np.flatnonzero(np.isfinite(error) & np.isfinite(value))
    known = known[:: max(1, -(-len(known) // MOST_SERIES_POINTS))]
    measured = error[np.isfinite(error)]
    rmse = float(np.sqrt(np.mean(measured**2)))
    sentence = f"{chosen.name} has fewer than two values where {rotation} was measured."
    if dependence is not None:
        sentence = dependence.sentence(rotation, rmse)
    every = [RecordedColumn(one.name, one.unit, one.phrase) for one in columns]
    return ResidualColumn(
        model, rotation, RecordedColumn(chosen.name, chosen.unit, chosen.phrase), every, rmse,
        float(np.mean(measured)), dependence, value[known].tolist(), error[known].tolist(), sentence,
    )  # fmt: skip
