"""A model and measurements over time, few enough points to draw, as an answer shows them."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from pydantic import BaseModel, Field

from glovecal_models.comparison.residuals import Residuals, TakeResiduals
from glovecal_models.comparison.shown_frames import shown_frames
from glovecal_service.plain import plain
from glovecal_service.store.records import TakeRecord

APART_S = 1.0
"""Between two takes on the linked axis."""


class TakeSeriesView(BaseModel):
    take: str
    name: str
    wearing: str
    trained_on: bool = Field(description="Whether the model was trained on this take.")
    start_s: float = Field(description="Of the first frame, by the take's clock.")
    end_s: float
    linked_s: float = Field(
        description="Where the take starts on the linked axis, on which takes stand after one another, 1 s "
        "apart: linked time is `time_s - start_s + linked_s`."
    )
    frames: int = Field(description="In the window, before some were chosen.")
    time_s: list[float] = Field(description="Of the frames chosen, by the take's clock.")
    measured_deg: list[float | None] = Field(description="Null where nothing was measured.")
    predicted_deg: list[float | None]
    sd_deg: list[float | None] = Field(description="Claimed standard deviation of a measurement.")
    error_deg: list[float | None] = Field(description="Predicted minus measured.")


class SeriesView(BaseModel):
    model: str
    rotation: str
    linked_s: float = Field(description="Length of the linked axis.")
    takes: list[TakeSeriesView] = Field(description="All takes asked for; without points outside the window.")


def series_view(
    found: Residuals,
    rows: Sequence[TakeRecord],
    model: str,
    rotation: str,
    *,
    window_s: tuple[float, float],
    points: int,
    trained_on: Collection[str],
) -> SeriesView:
    """Of takes ``rows``, in the order of the residuals; ``window_s`` is on the linked axis.

    ``points`` are shared out by how many frames of each take are in the window; extremes are kept.
    """
    column = found.column(rotation)
    starts, at = [], 0.0
    for item in found.takes:
        starts.append(at)
        at += item.take.duration_s + APART_S
    inside = [_inside(item, start, window_s) for item, start in zip(found.takes, starts, strict=True)]
    every = max(1, sum(map(len, inside)))
    takes = []
    for item, row, start, frames in zip(found.takes, rows, starts, inside, strict=True):
        columns = np.column_stack(
            [one[frames, column] for one in (item.measured, item.predicted, item.error)]
        )
        most = max(FEWEST, points * len(frames) // every)
        chosen = frames[shown_frames(columns, most)] if len(frames) else frames
        takes.append(
            TakeSeriesView(
                take=row.id,
                name=row.name,
                wearing=row.wearing,
                trained_on=row.id in trained_on,
                start_s=float(item.take.time_s[0]),
                end_s=float(item.take.time_s[-1]),
                linked_s=start,
                frames=len(frames),
                time_s=item.take.time_s[chosen].tolist(),
                measured_deg=plain(item.measured[chosen, column]),
                predicted_deg=plain(item.predicted[chosen, column]),
                sd_deg=plain(item.sd[chosen, column]),
                error_deg=plain(item.error[chosen, column]),
            )
        )
    return SeriesView(model=model, rotation=rotation, linked_s=max(0.0, at - APART_S), takes=takes)


FEWEST = 20
"""Points of a take that has any."""


def _inside(item: TakeResiduals, linked_s: float, window_s: tuple[float, float]) -> np.ndarray:
    """Frames in the window and one on either side, so that lines reach its edges."""
    time = item.take.time_s - item.take.time_s[0] + linked_s
    first, last = np.searchsorted(time, window_s[0]), np.searchsorted(time, window_s[1], side="right")
    if first >= last:
        return np.arange(0)
    return np.arange(max(0, first - 1), min(len(time), last + 1))
