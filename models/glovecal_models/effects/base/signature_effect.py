"""Effects known by a signature in the recording: no columns; they are found and, where possible, repaired.

A saturated sensor or a padded recording has lost information; no column of any calibration brings it back.
What helps is to say where, to leave the frames out, or to widen the interval.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from glovecal_models.effects.base.columnless_effect import ColumnlessEffect
from glovecal_models.effects.base.effect import Signals
from glovecal_models.errors import BadInput
from glovecal_models.takes.take import Take

MOST_NAMED = 4
"""A sentence names so many sensors or takes; the rest is counted."""


@dataclass(frozen=True)
class Stretch:
    """A piece of a take, both ends included."""

    take: str
    start_s: float
    end_s: float


@dataclass(frozen=True)
class Finding:
    """One thing found, with what speaks for it."""

    effect: str
    where: tuple[str, ...]
    """Sensors, rotations or (where whole frames are concerned) takes."""
    sentence: str
    kind: str = ""
    """Which of an effect's several signatures, such as "stuck"."""
    size_deg: float | None = None
    count: int | None = None
    evidence: Mapping[str, float] = field(default_factory=dict)
    """Numbers whose names end with their unit."""
    stretches: tuple[Stretch, ...] = ()


class SignatureEffect(ColumnlessEffect):
    """Implement ``find``; ``repaired`` where the recording can be mended."""

    def missing(self, takes: Sequence[Signals]) -> str | None:
        """Columns cannot judge a signature; ``find`` looks for itself and finds nothing where it cannot."""
        return None

    @abstractmethod
    def find(
        self,
        takes: Sequence[Take],
        sensor_of: Mapping[str, str],
        errors: Sequence[np.ndarray] | None = None,
    ) -> tuple[Finding, ...]:
        """What is found in ``takes``, the largest first.

        ``sensor_of`` names each rotation's own sensor; ``errors`` is, for each take, a calibrated model's
        error (N, len(sensor_of)) at the frames, degrees, NaN where there is no reference. Raises BadInput
        for sensors that a take does not have and for errors of another shape.
        """

    def repaired(self, takes: Sequence[Take]) -> tuple[Take, ...]:
        """The takes with the effect taken out of the measurement; by default they stay as they are."""
        return tuple(takes)


def check_signature_input(
    takes: Sequence[Take], sensor_of: Mapping[str, str], errors: Sequence[np.ndarray] | None
) -> None:
    """Raise BadInput for what ``find`` cannot use."""
    for take in takes:
        for rotation, sensor in sensor_of.items():
            if sensor not in take.sensors:
                raise BadInput(
                    f"take {take.name!r} has no sensor {sensor!r} for rotation {rotation}; "
                    f"it has {', '.join(take.sensors)}"
                )
    if errors is None:
        return
    if len(errors) != len(takes):
        raise BadInput(f"errors of {len(errors)} takes were given for {len(takes)} takes")
    for take, error in zip(takes, errors, strict=True):
        if error.shape != (len(take.time_s), len(sensor_of)):
            raise BadInput(
                f"take {take.name!r}: errors have shape {error.shape}, "
                f"expected {(len(take.time_s), len(sensor_of))}"
            )


def stretches_of(take: Take, frames: np.ndarray) -> tuple[Stretch, ...]:
    """The runs of True in ``frames`` (N,) as stretches."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], frames, [False]]).astype(int)))
    time = take.time_s
    return tuple(
        Stretch(take.name, float(time[start]), float(time[end - 1]))
        for start, end in zip(edges[::2], edges[1::2], strict=True)
    )


def frames_inside(take: Take, stretches: Sequence[Stretch]) -> np.ndarray:
    """(N,) True for the take's frames in any of the stretches."""
    inside = np.zeros(len(take.time_s), dtype=bool)
    for item in stretches:
        if item.take == take.name:
            inside |= (take.time_s >= item.start_s) & (take.time_s <= item.end_s)
    return inside


def named(names: Sequence[str]) -> str:
    """Names in a row for a sentence, such as "A, B and 3 more"."""
    shown = ", ".join(names[:MOST_NAMED])
    return shown if len(names) <= MOST_NAMED else f"{shown} and {len(names) - MOST_NAMED} more"


def smallest_step(values: np.ndarray) -> float:
    """The quantum of (N,) values: their smallest change; 0 when they never change."""
    steps = np.abs(np.diff(values))
    steps = steps[np.isfinite(steps) & (steps > 0)]
    return float(steps.min()) if len(steps) else 0.0
