"""What effects known by a signature in the recording find there, and what follows from it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numpy as np

from glovecal_models.effects.base.signals import Settings
from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean
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
    is_only_told: bool = False
    """Whether no model is better for it: it is to be put right at the glove."""
    error_square: float | None = None
    """How much of the squared error is where it was found, degrees squared per frame; None: not known."""
    accounts_for: tuple[str, ...] = ()
    """Effects that would seem to explain it, and are not needed beside it."""
    rivals: tuple[str, ...] = ()
    """Effects that it may be instead, where these save error on the same rotation."""
    part_of: tuple[str, ...] = ()
    """Effects that it is a part of, where these are found at other sensors too."""


class Finder(Protocol):
    """An effect that is found by its signature."""

    name: str

    def find(self, takes: Sequence[Take], sensor_of: Mapping[str, str]) -> tuple[Finding, ...]: ...


class FoundBefore:
    """What signatures were found in some takes, for whoever looks at the same takes again."""

    def __init__(self) -> None:
        self._found: dict[tuple[object, ...], tuple[tuple[Take, ...], tuple[Finding, ...]]] = {}

    def find(
        self, effect: Finder, takes: Sequence[Take], sensor_of: Mapping[str, str]
    ) -> tuple[Finding, ...]:
        """As ``effect.find``, without errors of a model; the same takes are the same objects."""
        key = (effect.name, *sensor_of.items(), *map(id, takes))
        if key not in self._found:
            # The takes are kept: another one could get the number of one that is gone.
            self._found[key] = tuple(takes), effect.find(takes, sensor_of)
        return self._found[key][1]


@dataclass(frozen=True)
class Recorded:
    """Takes in which an effect is looked for by its signature."""

    takes: tuple[Take, ...]
    sensor_of: Mapping[str, str]
    """Each rotation's own sensor."""
    static_errors: Callable[[], list[np.ndarray]]
    """For each take (N, len(sensor_of)), degrees: what a smooth curve of the own sensors leaves."""
    only_held_levels: bool = False
    """Whether the takes only hold one angle after another: nothing moves, and repeats mean nothing."""
    found_before: FoundBefore = field(default_factory=FoundBefore, compare=False)


@dataclass(frozen=True)
class Proposal:
    """An effect as it would be added."""

    constants: Settings
    rotations: tuple[str, ...] | None = None
    """None: all."""
    sentences: tuple[str, ...] = ()
    confidence_set: tuple[str, ...] = ()
    """It and all that the recording cannot tell from it; empty: it alone."""


@dataclass(frozen=True)
class LiveCheck:
    """How an effect acts on live frames, learned from takes, and how well that does on other takes."""

    settings: Settings
    """Added to the effect's; empty: it does not act live."""
    sentence: str
    evidence: Mapping[str, float]


class Held(NamedTuple):
    """One frame with what a failing sensor says left out."""

    base: np.ndarray
    """(R,) degrees."""
    readings: np.ndarray
    """(S,) raw counts."""
    variance: np.ndarray
    """(R,) degrees squared, by which the joint may have moved since."""
    is_faulty: np.ndarray
    """(R,)."""
    sensors: tuple[str, ...]
    """Those that fail."""


class Hold(ABC):
    """Keeps rotations at their last good angle while a sensor fails: the state of one glove, causal."""

    @abstractmethod
    def frame(self, time_s: float, base: np.ndarray, readings: np.ndarray) -> Held:
        """For the next frame: its prediction ``base`` (R,), degrees, and readings (S,)."""

    @abstractmethod
    def reset(self) -> None:
        """A new run or wearing."""


@dataclass(frozen=True)
class ClaimedErrors:
    """The n measured frames of one rotation in one take; the calibration that predicted them never saw it."""

    take: str
    rotation: str
    since_start_s: np.ndarray
    """(n,), since the first frame of the take."""
    error: np.ndarray
    """(n,), predicted minus measured, degrees."""
    measured: np.ndarray
    """(n,), degrees."""
    variance: np.ndarray
    """(n,), claimed, measurement noise included, degrees squared."""
    noise: float
    """The share of measurement noise in ``variance``, degrees squared."""
    sensors: tuple[str, ...]
    readings: np.ndarray
    """(n, S), raw counts."""


class Interval(ABC):
    """What an effect's settings mean for the claimed variance of L rotations."""

    needs_time: bool = False
    """Whether it grows with time."""

    @abstractmethod
    def added_variance(self, since_start_s: np.ndarray, readings: np.ndarray) -> np.ndarray:
        """(N, L) degrees squared beside the claimed variance, from readings (N, S).

        Negative, but never below minus the measurement noise, where the effect explains what training took
        for noise. ``since_start_s`` (N,) counts from the first frame of a run or wearing.
        """


def check_signature_input(
    takes: Sequence[Take], sensor_of: Mapping[str, str], errors: Sequence[np.ndarray] | None
) -> None:
    """Raise BadInput for what ``find`` cannot use."""
    for take in takes:
        for rotation, sensor in sensor_of.items():
            if sensor not in take.sensors:
                raise BadInput(
                    f"take {take.name!r} has no sensor {sensor!r} for rotation {rotation}; "
                    f"{did_you_mean(sensor, take.sensors, there='it has')}"
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
