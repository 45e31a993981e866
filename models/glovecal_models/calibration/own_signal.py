"""The signal of its own that a joint's base gives to the effects on top of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from glovecal_models.calibration.prepared_takes import PreparedTakes
from glovecal_models.layout import Correspondence
from glovecal_models.regression.regressor import Regressor


@dataclass(frozen=True)
class OwnSignal:
    """What the base says of one rotation."""

    takes: list[np.ndarray]
    """For each take (N,), degrees."""
    zero_deg: float
    """At a raw reading of zero, by a straight line through all takes."""

    @classmethod
    def of(cls, takes: PreparedTakes, correspondence: Correspondence, regressor: Regressor) -> OwnSignal:
        inputs = takes.inputs(correspondence)
        own = [_predicted(regressor, part) for part in inputs]
        x, y = np.concatenate([part[:, 0] for part in inputs]), np.concatenate(own)
        variance = float(np.var(x))
        slope = float(np.mean((x - x.mean()) * (y - y.mean()))) / variance if variance > 0 else 0.0
        return cls(own, float(y.mean() - slope * x.mean()))


def _predicted(regressor: Regressor, inputs: np.ndarray) -> np.ndarray:
    """(N,), degrees; a single sensor's counts come again and again, and each is predicted once."""
    if inputs.shape[1] > 1:
        return regressor.mean(inputs)
    different, which = np.unique(inputs[:, 0], return_inverse=True)
    return regressor.mean(different[:, None])[which]
