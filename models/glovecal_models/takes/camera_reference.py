"""A camera's estimates as the reference of the take that the glove recorded meanwhile.

Where a camera's clock lies against the glove's, with its standard deviation.

Each rotation that the camera accepts is held against the sensor that goes along with it most. First the
correlations of all rotations are searched over whole steps, as usual. Their maximum is found again in finer
steps by the likelihood: at each offset a cubic in the sensor explains the camera's angle, errors are
first-order autoregressive (what a camera gets wrong lasts for some tenths of a second), and each sample
counts by its stated deviation. A parabola through the least gives the offset. Its standard deviation is that
of the sandwich (White 1982): the curvature on both sides of the scatter of the likelihood's slope, summed
over blocks of ``BLOCK_S``, so that errors which last longer than the model has it do not make it too small.
Readings are smoothed before: steps of the converter, read at times between frames, would make the likelihood
rough.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.takes.camera_estimates import ALIKE_S, CameraEstimates, CoveredRange, covered_ranges
from glovecal_models.takes.take import Take

RANGE_S = 3.0
COARSE_S, FINE_S = 0.02, 0.004
FINE_WITHIN_S = 0.08
PARABOLA_WITHIN_S = 0.024
SMOOTHED_S = 0.06
"""Width of the window (Hann) that readings go through."""
BLOCK_S = 1.5
FEWEST_ACCEPTED = 100
"""Accepted samples of a rotation, about three seconds: fewer say nothing about time."""
LEAST_MOVEMENT_DEG = 3.0
"""Standard deviation of a rotation's accepted angles."""
BETTER_BY = 8.0
"""Nats by which the best offset must beat readings played backwards, which is chance, and offsets further
than ``OTHER_OFFSET_S`` away; samples within ``ALIKE_S`` count as one."""
OTHER_OFFSET_S = 0.3
MOST_SD_S = 0.02
READING_DEGREE = 3
"""Of the map from reading to angle."""
LONGEST_PAIR_S = 0.15
"""Samples further apart are not taken for neighbours."""
CAMERA_PATCHES = "camera_patches"
"""Context column: how many patches of the glove the camera saw. What goes with it is the camera's."""


@dataclass(frozen=True)
class CameraClock:
    """Camera time = glove time + offset."""

    offset_s: float
    sd_s: float
    """Of the offset; exposure and readout, which the stamps may hold, are not in it."""
    sensors: dict[str, str]
    """For each rotation that told the time the sensor it was held against."""


def camera_clock(
    take: Take, estimates: CameraEstimates, *, near_s: float = 0.0, within_s: float = RANGE_S
) -> CameraClock:
    """The offset, searched ``within_s`` of ``near_s``. Raises BadInput where it cannot be found."""
    told = [
        column
        for column in range(len(estimates.rotations))
        if estimates.accepted[:, column].sum() >= FEWEST_ACCEPTED
        and np.std(estimates.angles_deg[estimates.accepted[:, column], column]) >= LEAST_MOVEMENT_DEG
    ]
    if not told or len(take.time_s) < FEWEST_ACCEPTED:
        raise BadInput(
            f"take {take.name!r}: the camera's clock cannot be found; no rotation that it accepts moves in "
            f"at least {FEWEST_ACCEPTED} frames. Show the hand and bend the fingers for ten seconds."
        )
    offsets = near_s + COARSE_S * np.arange(-round(within_s / COARSE_S), round(within_s / COARSE_S) + 1)
    gains = _gains(take, estimates, told, offsets, take.readings)
    chosen = gains.max(axis=0).argmax(axis=1)
    total = gains[:, np.arange(len(told)), chosen].sum(axis=1)
    best = int(np.argmax(total))
    chance = _gains(take, estimates, told, offsets, take.readings[::-1]).max(axis=2).sum(axis=1).max()
    elsewhere = total[np.abs(offsets - offsets[best]) > OTHER_OFFSET_S].max(initial=0.0)
    counted = min(1.0, estimates.interval_s / ALIKE_S)
    if (total[best] - max(chance, elsewhere)) * counted < BETTER_BY or best in (0, len(offsets) - 1):
        raise BadInput(
            f"take {take.name!r}: the camera's clock was not found within {within_s:g} s of {near_s:g} s "
            "(another time, or readings played backwards, fit nearly as well). Do both recordings show the "
            "same movement?"
        )
    smooth = _smoothed(take.time_s, take.readings)
    lanes = [
        _Lane.of(take.time_s, smooth[:, sensor], estimates, column, float(offsets[best]))
        for column, sensor in zip(told, chosen, strict=True)
    ]
    centre, curvature = _least(lanes, float(offsets[best]))
    scores = _block_scores(lanes, centre)
    sd = float(np.sqrt(np.sum(scores**2))) / curvature if curvature > 0 else np.inf
    if not sd <= MOST_SD_S:
        raise BadInput(
            f"take {take.name!r}: the camera's clock is only known to {1e3 * sd:.0f} ms; bend the fingers "
            "quickly for ten seconds"
        )
    pairs = zip(told, chosen, strict=True)
    return CameraClock(centre, sd, {estimates.rotations[one]: take.sensors[other] for one, other in pairs})


def _smoothed(time_s: np.ndarray, readings: np.ndarray) -> np.ndarray:
    width = max(1, round(SMOOTHED_S / float(np.median(np.diff(time_s)))))
    half = width // 2
    window = np.hanning(2 * half + 3)[1:-1]
    padded = np.pad(readings, ((half, half), (0, 0)), mode="edge")
    return np.column_stack([np.convolve(column, window / window.sum(), "valid") for column in padded.T])


def _least(lanes: Sequence[_Lane], centre: float) -> tuple[float, float]:
    """The offset of the least, seconds, and the second derivative there; 0 where there is none."""
    steps = FINE_S * np.arange(-round(FINE_WITHIN_S / FINE_S), round(FINE_WITHIN_S / FINE_S) + 1)
    square = 0.0
    for _ in range(4):  # a parabola around its own least
        values = np.sum([[lane.nlml(centre + step) for step in steps] for lane in lanes], axis=0)
        least = steps[int(np.argmin(values))]
        near = np.abs(steps - least) <= PARABOLA_WITHIN_S + 1e-9
        square, slope, _ = np.polyfit(steps[near], values[near], 2)
        moved = -slope / (2.0 * square) if square > 0 else least
        centre += float(np.clip(moved, -FINE_WITHIN_S, FINE_WITHIN_S))
        if abs(moved) < 0.25 * FINE_S:
            break
    return float(centre), float(2.0 * max(square, 0.0))


def _block_scores(lanes: Sequence[_Lane], offset_s: float) -> np.ndarray:
    """(B,) slopes of the likelihood in each block of time, all rotations together."""
    first = min(float(lane.time_s[0, 1]) for lane in lanes)
    last = max(float(lane.time_s[-1, 1]) for lane in lanes)
    found = np.zeros(int((last - first) / BLOCK_S) + 1)
    for lane in lanes:
        block = ((lane.time_s[:, 1] - first) / BLOCK_S).astype(int)
        found += np.bincount(block, lane.scores(offset_s), len(found))
    return found


def _gains(
    take: Take,
    estimates: CameraEstimates,
    told: Sequence[int],
    offsets: np.ndarray,
    readings: np.ndarray,
) -> np.ndarray:
    """(offsets, rotations, sensors): log likelihood that a line through the sensor gains for each
    rotation."""
    scaled = (readings - readings.mean(axis=0)) / np.maximum(readings.std(axis=0), 1e-9)
    angles = np.where(estimates.accepted[:, told], estimates.angles_deg[:, told], 0.0)
    found = np.zeros((len(offsets), len(told), scaled.shape[1]))
    for place, offset in enumerate(offsets):
        at = estimates.time_s - offset
        inside = (at >= take.time_s[0]) & (at <= take.time_s[-1])
        known = (estimates.accepted[:, told] & inside[:, None]).astype(float)
        x = np.column_stack([np.interp(at, take.time_s, column) for column in scaled.T])
        count = np.maximum(known.sum(axis=0), 1.0)[:, None]
        y = known * angles
        mean_x, mean_y = known.T @ x / count, y.sum(axis=0)[:, None] / count
        together = y.T @ x / count - mean_x * mean_y
        square_x = known.T @ x**2 / count - mean_x**2
        square_y = (y**2).sum(axis=0)[:, None] / count - mean_y**2
        share = together**2 / np.maximum(square_x * square_y, 1e-12)
        enough = known.sum(axis=0)[:, None] >= FEWEST_ACCEPTED
        found[place] = np.where(enough, -0.5 * count * np.log1p(-np.minimum(share, 1 - 1e-9)), 0.0)
    return found


@dataclass(frozen=True)
class _Lane:
    """One rotation beside its sensor: P pairs of neighbouring accepted samples, errors whitened."""

    frame_s: np.ndarray
    """(N,), seconds of the glove's clock."""
    reading: np.ndarray
    """(N,), smoothed, standardised."""
    time_s: np.ndarray
    """(P, 2), seconds of the camera's clock, each sample after the one before."""
    target: np.ndarray
    """(P, 2), angles in units of their stated deviation."""
    deviation: np.ndarray
    """(P, 2), degrees."""
    correlation: float = 0.0
    """Of errors of neighbouring samples."""

    @classmethod
    def of(
        cls,
        frame_s: np.ndarray,
        reading: np.ndarray,
        estimates: CameraEstimates,
        column: int,
        offset_s: float,
    ) -> _Lane:
        accepted, time = estimates.accepted[:, column], estimates.time_s
        at = time - offset_s
        margin = FINE_WITHIN_S + PARABOLA_WITHIN_S
        inside = (at >= frame_s[0] + margin) & (at <= frame_s[-1] - margin)
        both = accepted[1:] & accepted[:-1] & inside[1:] & inside[:-1] & (np.diff(time) <= LONGEST_PAIR_S)
        rows = np.flatnonzero(both)
        pairs = np.column_stack([rows, rows + 1])
        deviation = estimates.sd_deg[pairs, column]
        standard = (reading - reading.mean()) / max(float(reading.std()), 1e-9)
        angles = estimates.angles_deg[pairs, column] / deviation
        lane = cls(frame_s, standard, time[pairs], angles, deviation)
        basis = lane._basis(offset_s)
        every = basis.reshape(-1, basis.shape[2])
        error = angles - basis @ np.linalg.lstsq(every, angles.ravel(), rcond=None)[0]
        correlation = float(np.sum(error[:, 0] * error[:, 1]) / max(np.sum(error[:, 0] ** 2), 1e-12))
        return replace(lane, correlation=float(np.clip(correlation, 0.0, 0.97)))

    def nlml(self, offset_s: float) -> float:
        """Negative log likelihood at its best map and noise, up to a constant."""
        left = self._whitened(offset_s)
        return 0.5 * len(left) * float(np.log(max(float(left @ left), 1e-12)))

    def scores(self, offset_s: float) -> np.ndarray:
        """(P,) what each pair adds to the derivative of ``nlml``."""
        left = self._whitened(offset_s)
        change = self._whitened(offset_s + FINE_S) - self._whitened(offset_s - FINE_S)
        return len(left) * left * change / (2.0 * FINE_S) / max(float(left @ left), 1e-12)

    def _whitened(self, offset_s: float) -> np.ndarray:
        """(P,) what a cubic in the sensor leaves of each angle beside the one before."""
        basis = self._basis(offset_s)
        rows = basis[:, 1] - self.correlation * basis[:, 0]
        y = self.target[:, 1] - self.correlation * self.target[:, 0]
        return y - rows @ np.linalg.lstsq(rows, y, rcond=None)[0]

    def _basis(self, offset_s: float) -> np.ndarray:
        """(P, 2, READING_DEGREE + 1), in units of the stated deviation."""
        x = np.interp(self.time_s - offset_s, self.frame_s, self.reading)
        powers = np.stack([x**power for power in range(READING_DEGREE + 1)], axis=-1)
        return powers / self.deviation[..., None]


@dataclass(frozen=True)
class CameraReference:
    """A take with the camera as its reference, and what is known of it."""

    take: Take
    clock: CameraClock
    ranges: tuple[CoveredRange, ...]
    accepted: float
    """Share of the camera's estimates that are kept, of the rotations that are kept."""

    def to_document(self) -> dict[str, Any]:
        """Plain JSON data, as a store keeps it."""
        return {
            "clock_offset_s": round(self.clock.offset_s, 6),
            "clock_offset_sd_s": round(self.clock.sd_s, 6),
            "accepted_share": round(self.accepted, 4),
            "ranges": [
                {
                    "rotation": item.rotation,
                    "ranges_deg": [[round(low, 2), round(high, 2)] for low, high in item.ranges_deg],
                    "effective_samples": item.effective_samples,
                    "sd_deg": None if item.sd_deg is None else round(item.sd_deg, 3),
                }
                for item in self.ranges
            ],
        }

    def sentences(self) -> list[str]:
        clock = self.clock
        first = (
            f"Take {self.take.name}: the camera's clock is {1e3 * abs(clock.offset_s):.1f} ms "
            f"{'ahead of' if clock.offset_s >= 0 else 'behind'} the glove's (SD {1e3 * clock.sd_s:.1f} ms); "
            f"{100 * self.accepted:.0f} % of its estimates are accepted."
        )
        return [first, *(item.sentence for item in self.ranges)]


def reference_from_camera(
    take: Take,
    estimates: CameraEstimates,
    *,
    rotations: Sequence[str] | None = None,
    near_s: float = 0.0,
    within_s: float = RANGE_S,
) -> CameraReference:
    """``take`` with the accepted estimates as its reference, each with its standard deviation.

    Rows stay at the camera's own times, moved by the clock offset: nothing is resampled, and no gap is
    filled (``Take.reference_at_frames`` interpolates between neighbouring accepted rows alone). Where the
    camera knows how many patches it saw, the take gets the context column ``camera_patches``.
    ``rotations``: those to keep, else all that were ever accepted. Raises BadInput where the clock's offset
    cannot be found, or nothing was accepted.
    """
    kept = [
        column
        for column, name in enumerate(estimates.rotations)
        if (rotations is None or name in rotations) and estimates.accepted[:, column].any()
    ]
    if not kept:
        raise BadInput(f"take {take.name!r}: the camera accepted no angle; nothing can be a reference")
    clock = camera_clock(take, estimates, near_s=near_s, within_s=within_s)
    time = estimates.time_s - clock.offset_s
    rows = (time >= take.start_s) & (time <= take.time_s[-1])
    accepted = estimates.accepted[np.ix_(rows, kept)]
    if not accepted.any():
        raise BadInput(f"take {take.name!r}: no accepted estimate lies within its frames")
    context = dict(take.context)
    if (estimates.patches[rows] >= 0).all():
        context[CAMERA_PATCHES] = np.interp(take.time_s, time[rows], estimates.patches[rows])
    found = replace(
        take,
        rotations=tuple(estimates.rotations[column] for column in kept),
        reference_time_s=time[rows],
        reference=np.where(accepted, estimates.angles_deg[np.ix_(rows, kept)], np.nan),
        reference_sd=np.where(accepted, estimates.sd_deg[np.ix_(rows, kept)], np.nan),
        context=context,
        simulated=take.simulated or estimates.simulated,
    )
    return CameraReference(found, clock, covered_ranges([found], found.rotations), float(accepted.mean()))
