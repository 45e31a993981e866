"""A protocol that grows: somebody tells, from what was recorded so far, which steps come next."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from glovecal_models.sampling.protocol import Step
from glovecal_models.sampling.reading import GloveReading
from glovecal_models.sampling.state import SamplingState

KEPT_OF_RANGE, KEPT_OF_MOTION = 64, 12


@dataclass(frozen=True)
class NextSteps:
    steps: tuple[Step, ...]
    are_last: bool
    """The protocol grows no more; with no steps either it is over."""
    sentence: str
    document: dict[str, Any] = field(default_factory=dict)
    """Why, as data."""


Choose = Callable[[SamplingState], NextSteps | None]
"""None: not known yet, ask again. It may be asked often and must not make the frames wait."""


def kept_readings(step: Step, readings: Sequence[GloveReading]) -> list[list[float]]:
    """What a step leaves in the state for choosing: its mean reading, or some spread over its motion."""
    values = np.array([reading.values for reading in readings], float)
    if not len(values):
        return []
    if step.motion == "hold":
        values = values.mean(axis=0)[None]
    most = KEPT_OF_RANGE if step.kind == "range" else KEPT_OF_MOTION
    chosen = np.linspace(0, len(values) - 1, min(most, len(values))).round().astype(int)
    return values[chosen].round(2).tolist()
