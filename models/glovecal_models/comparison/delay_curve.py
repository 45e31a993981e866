"""The error of angles that wait for the frames after them, from live to offline."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.offline import OfflinePredictor
from glovecal_models.comparison.delay_answer import DELAYS_MS, DelayedError
from glovecal_models.comparison.residuals import Residuals, residuals
from glovecal_models.takes.take import Take


class LiveAndDelayed(NamedTuple):
    """What angles that are estimated offline are held against."""

    live: Residuals
    delayed: tuple[DelayedError, ...]


def live_and_delayed(model: CalibrationModel, takes: Sequence[Take], offline: Residuals) -> LiveAndDelayed:
    """Of the same ``takes`` as ``offline``. Raises as ``residuals`` does."""
    return LiveAndDelayed(residuals(model, takes), _delayed_errors(model, offline))


def _delayed_errors(model: CalibrationModel, offline: Residuals) -> tuple[DelayedError, ...]:
    """Of the takes of ``offline``, all rotations together, for each of ``DELAYS_MS``."""
    delays_s = [delay / 1000 for delay in DELAYS_MS]
    predictor, squares = OfflinePredictor(model), [np.empty(0) for _ in DELAYS_MS]
    for item in offline.takes:
        take = item.take
        index = [take.sensors.index(name) for name in model.layout.sensors]
        each = predictor.predict_delayed(
            take.time_s,
            take.readings[:, index],
            take.context,
            take.wearing,
            delays_s,
        )
        for number, angles in enumerate(each):
            error = angles.mean - item.measured
            squares[number] = np.append(squares[number], error[np.isfinite(error)] ** 2)
    return tuple(
        DelayedError(delay, float(np.sqrt(square.mean())))
        for delay, square in zip(DELAYS_MS, squares, strict=True)
    )
