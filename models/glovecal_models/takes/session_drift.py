"""How far a glove's readings of the same hand shapes have moved between the start and the end of a session.

Krnoul et al. 2016 (section 4) record the calibration sequence at both ends. Each shape is a take in which it
is held; its readings are the median of the frames in which the hand was still. A person repeats a shape to
some degrees only: a single shape tells little of the drift, the mean over shapes more.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.takes.still_hand import stillest
from glovecal_models.takes.take import Take

SHAPES = {
    "flat": "Lay the hand flat, fingers together.",
    "spread": "Spread all fingers as far as they go.",
    "fist": "Make a fist, the thumb outside.",
    "o-index": "Touch the thumb's tip with the index finger's, like an o.",
    "o-pinky": "Touch the thumb's tip with the little finger's, like an o.",
}
"""The five shapes of the calibration take (section 3.3.4), each with what to say to a person."""
START, END = "start-", "end-"
"""Takes of a sequence are named by its place and the shape: ``start-fist``."""
MOST_MOVING = 0.05
"""Spread of readings in that part, as a share of their range in all takes. Of simulated gloves 0.015 to 0.018
in held shapes, 0.13 to 0.16 in free motion."""
NEARER = 2.0
"""A shape at the end that is so much nearer to another shape at the start is not the shape it is called."""


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
    left_out: Mapping[str, str] = field(default_factory=dict)
    """Why, by shape."""

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
    """``start`` and ``end``: a take by shape. What was not held still, or is another shape, is left out.

    Raises BadInput where no shape was held in both, or sensors differ.
    """
    shapes = tuple(name for name in start if name in end)
    if not shapes:
        raise BadInput(f"no shape is in both sequences: {', '.join(start)} and {', '.join(end)}")
    sensors = start[shapes[0]].sensors
    for take in (*start.values(), *end.values()):
        if take.sensors != sensors:
            raise BadInput(f"take {take.name!r} has other sensors than {start[shapes[0]].name!r}")
    range_ = _range([*start.values(), *end.values()])
    moved = {
        name: f"the hand moved in {' and '.join(places)} by {100 * worst:.0f} % of its range"
        for name in shapes
        if (found := _moving(start[name], end[name], range_))
        for places, worst in [found]
    }
    still = [name for name in shapes if name not in moved]
    mistaken = _other_shapes(still, start, end, range_)
    left_out, shapes = moved | mistaken, tuple(name for name in still if name not in mistaken)
    if not shapes:
        why = "; ".join(f"{name}: {reason}" for name, reason in left_out.items())
        raise BadInput(f"no shape was held at both ends, so no drift is known ({why}). Record them again")
    before, after = (np.array([held(takes[name]) for name in shapes]) for takes in (start, end))
    rotations: tuple[str, ...] = ()
    degrees = np.empty((len(shapes), 0))
    if predictor is not None:
        columns = [sensors.index(name) for name in predictor.sensors]
        rotations = tuple(predictor.rotations)
        degrees = predictor.predict(after[:, columns]).mean - predictor.predict(before[:, columns]).mean
    return SessionDrift(shapes, sensors, after - before, rotations, degrees, left_out)


def _range(takes: Sequence[Take]) -> np.ndarray:
    """(S,), at least one count."""
    readings = [take.readings for take in takes]
    low, high = (np.array([getattr(one, end)(axis=0) for one in readings]) for end in ("min", "max"))
    return np.maximum(high.max(axis=0) - low.min(axis=0), 1.0)


def _moving(start: Take, end: Take, range_: np.ndarray) -> tuple[list[str], float] | None:
    """In which of both the hand was not held still, and by which share of its range it moved at most."""
    shares = {
        place: float(np.sqrt(np.mean((_stillest(take).std(axis=0) / range_) ** 2)))
        for place, take in (("the first", start), ("the last", end))
    }
    moving = {place: share for place, share in shares.items() if share > MOST_MOVING}
    return (list(moving), max(moving.values())) if moving else None


def _other_shapes(
    names: Sequence[str], start: Mapping[str, Take], end: Mapping[str, Take], range_: np.ndarray
) -> dict[str, str]:
    """Which at the end are none of theirs at the start, beside a drift that all have in common."""
    if len(names) < 2:
        return {}
    before, after = (np.array([held(takes[name]) for name in names]) / range_ for takes in (start, end))
    drift = np.median(after - before, axis=0)
    apart = np.sqrt(np.mean((after[:, None] - before[None] - drift) ** 2, axis=2))
    found = {}
    for at, name in enumerate(names):
        nearest = int(apart[at].argmin())
        if NEARER * apart[at, nearest] < apart[at, at]:
            found[name] = f"at the end the hand looks like {names[nearest]}"
    return found


def held(take: Take) -> np.ndarray:
    """(S,): the median reading of the stillest second of what was asked for."""
    return np.median(_stillest(take), axis=0)


def _stillest(take: Take) -> np.ndarray:
    """(N, S): readings of that second."""
    return take.readings[stillest(take)]


def shape_of(take: str) -> str | None:
    """The shape that a take of this name holds; None for any other take."""
    for place in (START, END):
        if take.startswith(place) and take.removeprefix(place) in SHAPES:
            return take.removeprefix(place)
    return None
