"""How far a glove's readings of the same hand shapes have moved between the start and the end of a session.

Krnoul et al. 2016 (section 4) record the calibration sequence at both ends. Each shape is a take in which it
is held; its readings are the median of the frames in which the hand was still. A person repeats a shape to
some degrees only: a single shape tells little of the drift, the mean over shapes more.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.takes.take import Take

SHAPES = {
    "flat": "Lay the hand flat, fingers together.",
    "spread": "Spread all fingers as far as they go.",
    "fist": "Make a fist, the thumb outside.",
    "o-index": "Touch the thumb's tip with the index finger's, like an o.",
    "o-pinky": "Touch the thumb's tip with the little finger's, like an o.",
}
"""The five shapes of the calibration take (section 3.3.4), each with what to say to a person."""
HELD_S = 1.0
"""The stillest part of a take, whose median counts."""


class _Angles(Protocol):
    @property
    def mean(self) -> np.ndarray: ...


class Predictor(Protocol):
    """What a GlovePredictor gives; a take knows no models."""

    @property
    def sensors(self) -> Sequence[str]: ...

    @property
    def rotations(self) -> Sequence[str]: ...

    def predict(self, readings: np.ndarray) -> _Angles: ...


@dataclass(frozen=True)
class SessionDrift:
    """End less start, of N shapes in both, S sensors and R rotations."""

    shapes: tuple[str, ...]
    sensors: tuple[str, ...]
    counts: np.ndarray
    """(N, S)."""
    rotations: tuple[str, ...]
    """Empty without a model."""
    degrees: np.ndarray
    """(N, R), by one model for both."""

    @property
    def rms_deg(self) -> float | None:
        """Over shapes and rotations; None without a model."""
        return float(np.sqrt(np.mean(self.degrees**2))) if self.degrees.size else None

    @property
    def common_deg(self) -> np.ndarray:
        """(R,): the mean over shapes, which a person's repeating of a single shape touches least."""
        return self.degrees.mean(axis=0)

    @property
    def common_counts(self) -> np.ndarray:
        """(S,)."""
        return self.counts.mean(axis=0)


def session_drift(
    start: Mapping[str, Take], end: Mapping[str, Take], predictor: Predictor | None
) -> SessionDrift:
    """``start`` and ``end``: a take by shape. Raises BadInput where none is in both, or sensors differ."""
    shapes = tuple(name for name in start if name in end)
    if not shapes:
        raise BadInput(f"no shape is in both sequences: {', '.join(start)} and {', '.join(end)}")
    sensors = start[shapes[0]].sensors
    for take in (*start.values(), *end.values()):
        if take.sensors != sensors:
            raise BadInput(f"take {take.name!r} has other sensors than {start[shapes[0]].name!r}")
    before, after = (np.array([held(takes[name]) for name in shapes]) for takes in (start, end))
    rotations: tuple[str, ...] = ()
    degrees = np.empty((len(shapes), 0))
    if predictor is not None:
        columns = [sensors.index(name) for name in predictor.sensors]
        rotations = tuple(predictor.rotations)
        degrees = predictor.predict(after[:, columns]).mean - predictor.predict(before[:, columns]).mean
    return SessionDrift(shapes, sensors, after - before, rotations, degrees)


def held(take: Take) -> np.ndarray:
    """(S,): the median reading of the stillest second of what was asked for."""
    asked = take.time_s >= take.start_s
    time_s, readings = take.time_s[asked], take.readings[asked]
    frames = max(1, int(np.searchsorted(time_s, time_s[0] + HELD_S)))
    spread = [
        float(readings[at : at + frames].std(axis=0).sum())
        for at in range(0, max(1, len(readings) - frames + 1), max(1, frames // 10))
    ]
    at = int(np.argmin(spread)) * max(1, frames // 10)
    return np.median(readings[at : at + frames], axis=0)
