"""The JSON body that asks the service for the rotations of readings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


def frames_to_predict(
    readings: ArrayLike,
    sensors: Sequence[str] | None,
    time_s: ArrayLike | None,
    context: Mapping[str, ArrayLike] | None,
    wearing: str | None,
) -> dict[str, Any]:
    """``readings`` (N, S) raw counts, ``time_s`` (N,), ``context`` columns (N,); what is None is left out."""
    body: dict[str, Any] = {"readings": np.asarray(readings, dtype=float).tolist()}
    if sensors is not None:
        body["sensors"] = list(sensors)
    if time_s is not None:
        body["time_s"] = np.asarray(time_s, dtype=float).tolist()
    if context is not None:
        body["context"] = {name: _or_none(column) for name, column in context.items()}
    if wearing is not None:
        body["wearing"] = wearing
    return body


def _or_none(column: ArrayLike) -> list[float | None]:
    """JSON has no NaN."""
    return [None if np.isnan(value) else value for value in np.asarray(column, dtype=float).tolist()]
