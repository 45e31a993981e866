"""A CyberGlove that exists only as numbers: angles in, raw counts out, one small object per step between.

    angles -> cloth (couplings) -> sensor curve -> wearing -> counts -> noise -> converter -> readings

Each step turns a signal of shape (N, S) into another of the same shape, row by row. The cloth and the sensor
curve speak in degrees of the measured rotation, everything after ``Counts`` in raw counts. A step with a
memory (hysteresis, creep, lag) fits between sensor curve and wearing and keeps its own state.

Counts per degree and zeros come from public calibration files (``typical_counts.py``), couplings have the
sizes of Wang & Neff 2013, Table 1 (``simulated_hand.py``), noise is that of Kessler et al. 1995 (mean 1.1
degrees) together with 8-bit steps, and wearings shift by a few degrees (Gracia-Ibanez et al. 2016 found 3.5
degrees with the same protocol on other days; a single day's wearings are set to a third of that). The
shapes of curve and coupling, and how far gloves differ, are choices.

Takes recorded from a simulated hand in a simulated glove, with the truth beside them.

The hand goes through segment after segment, with a short movement from each into the next.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG
from glovecal_models.layout import Layout
from glovecal_models.names import did_you_mean
from glovecal_models.simulation.protocol import Segment, minimum_jerk
from glovecal_models.simulation.simulated_hand import DRIVEN, ROTATIONS, SimulatedHand, bent_share, stretches
from glovecal_models.takes.take import Take
from glovecal_models.typical_counts import TYPICAL_COUNTS

BRIDGE_S = 0.4
"""How long the hand takes from the end of one segment to the start of the next."""


class SensorStage(Protocol):
    """One step of a simulated sensor."""

    def apply(self, signal: np.ndarray, random: np.random.Generator) -> np.ndarray:
        """The signal after this step; ``signal`` and result have shape (N, S), rows in order of time."""
        ...


class Cloth:
    """The first step: what each sensor is bent and stretched by, in degrees, from the hand's rotations.

    The sensor's own rotation, plus its neighbours' pulls (stretch.py). Between two bent fingers the sensor
    also answers less to their spread: ``slack`` times their mean bend is lost. That is a product of three
    angles, beyond any linear map.
    """

    def __init__(self, sensors: Sequence[str], rotations: Sequence[str], slack: float = 0.25) -> None:
        self._own = [rotations.index(name) for name in sensors]
        self._slack = slack
        self._column = {name: column for column, name in enumerate(sensors)}
        self._stretches = [stretch for stretch in stretches() if stretch.sensor in self._column]
        neighbours = {pull.neighbour for stretch in self._stretches for pull in stretch.pulls}
        self._neighbours = {name: rotations.index(name) for name in neighbours}

    def strain(self, angles: np.ndarray) -> np.ndarray:
        """Shape (N, S) degrees, from ``angles`` of shape (N, len(rotations)), degrees."""
        strain = angles[:, self._own]
        bent = {name: bent_share(name, angles[:, column]) for name, column in self._neighbours.items()}
        for stretch in self._stretches:
            low, high = ACTIVE_RANGE_DEG[stretch.sensor]
            column = self._column[stretch.sensor]
            if stretch.together:
                both = [bent[pull.neighbour] for pull in stretch.pulls[:2]]
                strain[:, column] *= 1 - self._slack * (both[0] + both[1]) / 2
            strain[:, column] += (high - low) * stretch.share(bent)
        return strain


@dataclass(frozen=True)
class SensorCurve:
    """Static nonlinearity: a sine bow over the active range, at most ``bow`` times the range."""

    low: np.ndarray
    high: np.ndarray
    bow: np.ndarray

    def apply(self, signal: np.ndarray, random: np.random.Generator) -> np.ndarray:
        span = self.high - self.low
        return signal + self.bow * span * np.sin(np.pi * (signal - self.low) / span)


@dataclass(frozen=True)
class Wearing:
    """How the glove sits this time: each sensor shifted by degrees and its answer scaled."""

    shift_deg: np.ndarray
    scale: np.ndarray

    def apply(self, signal: np.ndarray, random: np.random.Generator) -> np.ndarray:
        return signal * self.scale + self.shift_deg


@dataclass(frozen=True)
class Counts:
    """From degrees to the converter's scale: counts at 0 degrees and counts per degree."""

    zero: np.ndarray
    gain: np.ndarray

    def apply(self, signal: np.ndarray, random: np.random.Generator) -> np.ndarray:
        return self.zero + self.gain * signal


@dataclass(frozen=True)
class Noise:
    """Independent noise of every frame, in counts."""

    sd: np.ndarray

    def apply(self, signal: np.ndarray, random: np.random.Generator) -> np.ndarray:
        return signal + self.sd * random.standard_normal(signal.shape)


@dataclass(frozen=True)
class Converter:
    """Rounds to whole counts and holds them within what the hardware can send."""

    lowest: float
    highest: float

    def apply(self, signal: np.ndarray, random: np.random.Generator) -> np.ndarray:
        return np.clip(np.rint(signal), self.lowest, self.highest)


LAYOUTS = ("cyberglove18", "cyberglove22")
ZERO_SD_COUNTS = 13.0
GAIN_LOG_SD = 0.15
LARGEST_BOW = 0.03
NOISE_DEG = 0.9
"""With 8-bit steps of about a degree the sum is near Kessler's 1.1 degrees."""
WEARING_SHIFT_SD_DEG = 0.6
WEARING_SCALE_SD = 0.006


class SimulatedGlove:
    """One glove on one hand in one wearing, fixed by ``seed`` and ``wearing``.

    The same seed is the same glove and hand; another ``wearing`` is the same glove put on again.
    """

    def __init__(self, seed: int = 0, layout: Layout | str = "cyberglove18", *, wearing: int = 0) -> None:
        """``layout`` is cyberglove18 or cyberglove22; raises BadInput for another."""
        self.layout = Layout.built_in(layout) if isinstance(layout, str) else layout
        if self.layout.name not in LAYOUTS:
            meant = did_you_mean(self.layout.name, LAYOUTS)
            raise BadInput(f"no glove of layout {self.layout.name!r} is simulated; {meant}")
        if seed < 0 or wearing < 0:
            raise BadInput(f"seed and wearing are counted from 0, not {seed} and {wearing}")
        self.seed = seed
        self.wearing = wearing
        self.hand = SimulatedHand(seed)
        self._cloth = Cloth(self.layout.sensors, self.layout.rotations)
        self.stages: tuple[SensorStage, ...] = self._build_stages()
        self._random = np.random.default_rng([seed, 4, wearing])

    @property
    def sensors(self) -> tuple[str, ...]:
        return self.layout.sensors

    @property
    def rotations(self) -> tuple[str, ...]:
        return self.layout.rotations

    def readings(self, angles: np.ndarray, random: np.random.Generator | None = None) -> np.ndarray:
        """Raw counts, shape (N, S), of the hand at ``angles``, shape (N, R), degrees, rows in order of time.

        Noise comes from ``random``, else from the glove's own stream, so that frame after frame gives what
        all frames at once give. Raises BadInput for a wrong shape.
        """
        angles = np.asarray(angles, float)
        if angles.ndim != 2 or angles.shape[1] != len(self.rotations):
            raise BadInput(f"angles have shape {angles.shape}, expected (N, {len(self.rotations)})")
        signal = self._cloth.strain(angles)
        for stage in self.stages:
            signal = stage.apply(signal, self._random if random is None else random)
        return signal

    def _build_stages(self) -> tuple[SensorStage, ...]:
        count = len(self.sensors)
        random = np.random.default_rng([self.seed, 2])
        typical_zero, typical_gain = np.array([TYPICAL_COUNTS[name] for name in self.sensors]).T
        low, high = np.array([ACTIVE_RANGE_DEG[name] for name in self.sensors]).T
        zero = typical_zero + ZERO_SD_COUNTS * random.standard_normal(count).clip(-2, 2)
        gain = typical_gain * np.exp(GAIN_LOG_SD * random.standard_normal(count).clip(-2, 2))
        bow = LARGEST_BOW * random.uniform(-1, 1, count)
        donning = np.random.default_rng([self.seed, 3, self.wearing])
        shift = WEARING_SHIFT_SD_DEG * donning.standard_normal(count)
        scale = 1 + WEARING_SCALE_SD * donning.standard_normal(count)
        lowest, highest = self.layout.counts or (1.0, 255.0)
        return (
            SensorCurve(low, high, bow),
            Wearing(shift, scale),
            Counts(zero, gain),
            Noise(NOISE_DEG * np.abs(gain)),
            Converter(lowest, highest),
        )


@dataclass(frozen=True)
class _Piece:
    """A segment at its place in time, and the movement before it from the posture ``before``."""

    segment: Segment
    begins_s: float
    starts_s: float
    ends_s: float
    before: np.ndarray | None

    def driven(self, time_s: np.ndarray) -> np.ndarray:
        inside = np.clip(time_s - self.starts_s, 0.0, self.segment.duration_s)
        driven = self.segment.driven(inside)
        if self.before is None:
            return driven
        share = (time_s - self.begins_s) / (self.starts_s - self.begins_s)
        return self.before + minimum_jerk(share)[:, None] * (driven - self.before)

    def poses(self, time_s: np.ndarray) -> list[str]:
        names = self.segment.poses(time_s - self.starts_s)
        return [name if at >= self.starts_s else "" for name, at in zip(names, time_s, strict=True)]


class Performance:
    """A hand's rotations and poses as functions of time from 0; after the last segment it stays still.

    ``segments`` may be endless; it is read as far as the times that are asked for.
    """

    def __init__(self, hand: SimulatedHand, segments: Iterable[Segment], rotations: Sequence[str]) -> None:
        self._hand = hand
        self._waiting = iter(segments)
        self._order = [ROTATIONS.index(rotation) for rotation in rotations]
        self._pieces: list[_Piece] = []
        self._starts: list[float] = []
        self._complete = False

    def at(self, time_s: np.ndarray) -> tuple[np.ndarray, tuple[str, ...]]:
        """Angles, shape (N, len(rotations)), degrees, and pose names at increasing times (N,)."""
        self._extend(float(time_s[-1]))
        index = np.searchsorted(self._starts, time_s, side="right") - 1
        driven = np.empty((len(time_s), len(DRIVEN)))
        poses: list[str] = []
        for piece in range(int(index[0]), int(index[-1]) + 1):
            rows = index == piece
            driven[rows] = self._pieces[piece].driven(time_s[rows])
            poses.extend(self._pieces[piece].poses(time_s[rows]))
        angles = self._hand.complete(dict(zip(DRIVEN, driven.T, strict=True)))
        return angles[:, self._order], tuple(poses)

    def _extend(self, until_s: float) -> None:
        while not self._complete and (not self._pieces or self._pieces[-1].ends_s <= until_s):
            segment = next(self._waiting, None)
            if segment is None:
                self._complete = True
            else:
                self._append(segment)

    def _append(self, segment: Segment) -> None:
        if self._pieces:
            last = self._pieces[-1]
            begins, starts = last.ends_s, last.ends_s + BRIDGE_S
            before = last.segment.driven(np.array([last.segment.duration_s]))[0]
        else:
            begins, starts, before = 0.0, 0.0, None
        self._pieces.append(_Piece(segment, begins, starts, starts + segment.duration_s, before))
        self._starts.append(begins)


def duration_s(segments: Sequence[Segment]) -> float:
    """How long a performance of all segments takes, in seconds."""
    return sum(segment.duration_s for segment in segments) + BRIDGE_S * max(len(segments) - 1, 0)


REFERENCE_NOISE_DEG = 0.7
NOT_MEASURED = ("PALM_ARCH",)
"""No reference system measures the palm's arch, so simulated takes have no reference for it."""


@dataclass(frozen=True)
class SimulatedTake:
    """A take as a recorder would keep it, and what the hand really did."""

    take: Take
    truth: np.ndarray
    """Shape (N, R), degrees, in the order of the layout's rotations, without measurement noise."""


def simulate_take(
    glove: SimulatedGlove,
    motion: Segment | Sequence[Segment],
    *,
    seed: int = 0,
    rate_hz: float = 120.0,
    reference_noise_deg: float = REFERENCE_NOISE_DEG,
    name: str | None = None,
) -> SimulatedTake:
    """Record one segment, or several moving from each into the next, marked as simulated.

    The reference is measured at the frames' times with independent noise. The same arguments give the
    same take, whatever else was recorded from ``glove``. Raises BadInput when there is nothing to record.
    """
    segments = [motion] if isinstance(motion, Segment) else list(motion)
    if not segments or not rate_hz > 0:
        raise BadInput(f"nothing to record: {len(segments)} segments at {rate_hz:g} Hz")
    time = np.arange(max(round(duration_s(segments) * rate_hz), 1)) / rate_hz
    truth, poses = Performance(glove.hand, segments, glove.rotations).at(time)
    random = np.random.default_rng([seed, 30, glove.wearing])
    readings = glove.readings(truth, random)
    measured = measured_rotations(glove)
    columns = [glove.rotations.index(rotation) for rotation in measured]
    take = Take(
        name=name or "-".join(dict.fromkeys(segment.name for segment in segments)),
        wearing=f"wearing-{glove.wearing}",
        sensors=glove.sensors,
        time_s=time,
        readings=readings,
        rotations=measured,
        reference_time_s=time,
        reference=truth[:, columns]
        + reference_noise_deg * random.standard_normal((len(truth), len(columns))),
        poses=poses if any(poses) else None,
        simulated=True,
    )
    return SimulatedTake(take, truth)


def measured_rotations(glove: SimulatedGlove) -> tuple[str, ...]:
    """Rotations a simulated take has a reference for."""
    return tuple(rotation for rotation in glove.rotations if rotation not in NOT_MEASURED)
