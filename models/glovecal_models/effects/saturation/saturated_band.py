"""The part of a sensor's range in which it no longer says where the joint is, and how unsure that leaves it.

Before anything is learned the whole band counts as unsure as the reference spreads in it. From errors on
held-out takes the band and its neighbours get a standard deviation for each narrow step of readings: a sensor
that flattens loses little at first and all at its end.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

import numpy as np

from glovecal_models.effects.base.findings import ClaimedErrors, Interval
from glovecal_models.effects.base.signals import Settings
from glovecal_models.takes.take import Take

STEPS_A_BAND, BANDS = 4, 3
"""Narrow steps in the band, and in each of its two neighbours."""
LEAST_STEP_FRAMES = 30
WITHIN_SD = 1.959964
"""Of the interval that is to cover 95 % of new measurements."""


@dataclass(frozen=True)
class SaturatedBand:
    """Readings between which a sensor no longer says where the joint is."""

    sensor: str
    rotation: str
    low: float
    high: float
    """Raw readings; the open end is the sensor's own."""
    end: Literal["low", "high", "middle"]
    towards: int
    """+1 when the true angle may be larger than predicted, -1 when smaller, 0 in a dead band in mid-range."""
    extra_sd_deg: float
    """What the reference spreads at the end, or in a dead band, beyond what it does elsewhere."""
    piled_up: float
    """Density of readings in the band over that beside it."""
    spread_ratio: float
    frames: int
    step_sd_deg: tuple[float, ...] = ()
    """Learned: standard deviation beside the claimed one, from the open end inwards; empty before."""
    lost_deg: float = 0.0
    """RMS over all frames of what is lost in the band."""

    @property
    def width(self) -> float:
        return self.high - self.low

    def extra_sd(self, readings: np.ndarray) -> np.ndarray:
        """(N,) degrees to be added (in squares) to the standard deviation."""
        if not self.step_sd_deg:
            return np.where(self.depth(readings) <= self.width, self.extra_sd_deg, 0.0)
        steps = np.array([*self.step_sd_deg, 0.0])
        return steps[np.minimum(self._step(readings), len(steps) - 1)]

    def depth(self, readings: np.ndarray) -> np.ndarray:
        """(N,) how far from the open end, counts; not negative. Of a dead band twice that from its middle."""
        if self.end == "middle":
            return np.abs(2.0 * readings - self.low - self.high)
        return np.maximum(self.high - readings if self.end == "high" else readings - self.low, 0.0)

    def is_near(self, readings: np.ndarray) -> np.ndarray:
        """(N,) whether in the band or its neighbours."""
        return self.depth(readings) < BANDS * self.width

    def learned(self, held_out: Sequence[ClaimedErrors], noise_share: float) -> SaturatedBand:
        """With steps from the errors of its rotation; ``noise_share`` of the noise is claimed elsewhere.

        Each step covers 95 % of its errors with 1.96 standard deviations, and is no smaller than their RMS.
        """
        readings = np.concatenate([item.readings[:, item.sensors.index(self.sensor)] for item in held_out])
        error = np.concatenate([item.error for item in held_out])
        claimed = np.concatenate([item.variance + (noise_share - 1.0) * item.noise for item in held_out])
        step = self._step(readings)
        found: list[float] = []
        for number in range(STEPS_A_BAND * BANDS):
            inside = step == number
            if inside.sum() < LEAST_STEP_FRAMES:
                found.append(found[-1] if found else self.extra_sd_deg)
                continue
            wide = float(np.quantile(np.abs(error[inside]), 0.95)) / WITHIN_SD
            needed = max(wide**2, float(np.mean(error[inside] ** 2)))
            found.append(float(np.sqrt(max(needed - float(claimed[inside].mean()), 0.0))))
        return replace(self, step_sd_deg=tuple(found))

    def to_settings(self) -> Settings:
        """Plain JSON-able data; ``SaturatedBand.of(settings)`` reads it back."""
        return asdict(self) | {"step_sd_deg": list(self.step_sd_deg)}

    @classmethod
    def of(cls, settings: Settings) -> SaturatedBand:
        values: dict[str, Any] = dict(settings)
        values["step_sd_deg"] = tuple(settings.get("step_sd_deg", ()))
        return cls(**values)

    def _step(self, readings: np.ndarray) -> np.ndarray:
        return np.floor(self.depth(readings) / self.width * STEPS_A_BAND).astype(int)


class SaturationInterval(Interval):
    """Of L rotations: wide near the bands, and elsewhere without the loss that training took for noise."""

    def __init__(
        self,
        bands: Sequence[SaturatedBand],
        noise_share: np.ndarray,
        rotations: Sequence[str],
        sensors: Sequence[str],
        noise: np.ndarray,
    ) -> None:
        self._everywhere = (noise_share - 1.0) * noise
        self._bands = [
            (band, list(rotations).index(band.rotation), list(sensors).index(band.sensor))
            for band in bands
            if band.rotation in rotations
        ]

    def added_variance(self, since_start_s: np.ndarray, readings: np.ndarray) -> np.ndarray:
        total = np.tile(self._everywhere, (len(readings), 1))
        for band, lane, sensor in self._bands:
            total[:, lane] += band.extra_sd(readings[:, sensor]) ** 2
        return total


# The bands of a sensor's readings in which it no longer says where the joint is. Found by steps of 4 % of a
# sensor's range. In those at its end the reference spreads far more than it does in a usual step, and a
# step holds more degrees. Where the reference rests, it is a posture. A dead band is told from a hand that
# rests, or a sensor that drops out to one value, by angles that differ on its two sides.


BAND = 0.04
STEPS, MOST_STEPS = round(1 / BAND), 8
"""In the range, and in a band at its end."""
SPREAD = 2.0
"""Of the angles in the end step over those in a usual one. Of 136 simulated gloves with other effects of 1.3
noise floors none reached it where the hand moved; of 16 that saturate at an end 13 did."""
ANSWERS_LESS = 1.4
"""Degrees in the step beside the end over those in a usual one."""
LOST_SHARE = 0.4
"""Of the usual spread: what is lost in the band, over all frames."""
PILED_UP = 3.0
LEAST_FRAMES = 30
LEAST_VISITS = 4
MIDDLE_BAND, CROSSED = 0.02, 2.0
"""Of a dead band: its share of the range, and how far apart the angles beside it are, in its own spread."""
MOVES_SHARE = 0.25
"""Of the reference's spread in the band, to be seen within visits to it: else the hand only rested there."""
LEAST_EXTRA_DEG = 2.0
"""A smaller loss is not worth a word."""


def saturated_bands(takes: Sequence[Take], sensor_of: Mapping[str, str]) -> tuple[SaturatedBand, ...]:
    """The bands in which sensors stop responding, at most three for each rotation."""
    found = []
    for rotation, sensor in sensor_of.items():
        pairs = [
            (take.readings[:, take.sensors.index(sensor)], take.reference_at_frames([rotation])[:, 0])
            for take in takes
            if rotation in take.rotations
        ]
        if not pairs:
            continue
        readings, angles = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
        known = np.isfinite(angles)
        for sign in (1, -1):
            band = _end_band(sensor, rotation, readings[known], angles[known], sign)
            if band is not None:
                found.append(band)
        band = _middle_band(sensor, rotation, readings[known], angles[known])
        if band is not None:
            found.append(band)
    return tuple(found)


def _end_band(
    sensor: str, rotation: str, readings: np.ndarray, angles: np.ndarray, sign: int
) -> SaturatedBand | None:
    """Judge the upper end (``sign`` 1) or, on readings turned over, the lower one (-1)."""
    if len(readings) < LEAST_FRAMES:
        return None
    value = sign * readings
    # Single spikes must not stretch the range.
    bottom, top = np.percentile(value, [0.1, 99.9])
    width = BAND * (top - bottom)
    if width <= 0:
        return None
    step = np.clip(((top - value) // width).astype(int), 0, STEPS - 1)
    frames = np.bincount(step, minlength=STEPS)
    mean = np.bincount(step, angles, STEPS) / np.maximum(frames, 1)
    spread = np.sqrt(np.bincount(step, (angles - mean[step]) ** 2, STEPS) / np.maximum(frames, 1))
    is_seen = frames >= LEAST_FRAMES
    # With few readings beside it, a pile tells nothing of what the sensor does on its way there.
    if not is_seen[:2].all() or is_seen.sum() < STEPS / 2:
        return None
    usual, slope = float(np.median(spread[is_seen])), np.abs(np.gradient(mean))
    is_wide = is_seen & (spread > SPREAD * usual)
    many = min(int(np.argmin(is_wide)) if not is_wide.all() else STEPS, MOST_STEPS)
    lost = np.sum(frames[:many] * (spread[:many] ** 2 - usual**2)) / len(readings)
    if not many or lost < (LOST_SHARE * usual) ** 2 or slope[1] < ANSWERS_LESS * np.median(slope[is_seen]):
        return None
    end, beside = step < many, (step >= many) & (step < 2 * many)
    extra = float(np.sqrt(spread[0] ** 2 - usual**2))
    visits = np.cumsum(np.diff(end, prepend=False) != 0)[end]
    inside = angles[end] - mean[step[end]]
    if extra < LEAST_EXTRA_DEG or _moves_within(visits, inside) < MOVES_SHARE * float(inside.std()):
        return None
    towards = 1 if np.median(angles[end]) >= np.median(angles[~end]) else -1
    edges = sorted((sign * (top - many * width), sign * max(float(value.max()), float(top))))
    return SaturatedBand(
        sensor, rotation, float(edges[0]), float(edges[1]), "high" if sign > 0 else "low", towards, extra,
        float(end.sum() / max(beside.sum(), 1)), float(spread[0] / max(usual, 1e-9)), int(end.sum()),
        lost_deg=float(np.sqrt(lost)),
    )  # fmt: skip


def _middle_band(
    sensor: str, rotation: str, readings: np.ndarray, angles: np.ndarray
) -> SaturatedBand | None:
    """The narrow band away from the ends in which most readings pile up, if it is dead."""
    if len(readings) < LEAST_FRAMES:
        return None
    bottom, top = np.percentile(readings, [0.1, 99.9])
    width = MIDDLE_BAND * (top - bottom)
    if width <= 0:
        return None
    steps = np.histogram(readings, np.arange(bottom, top + width, width / 2))[0]
    pairs, margin = steps[:-1] + steps[1:], round(2 * 2 * BAND / MIDDLE_BAND)
    if len(pairs) <= 2 * margin:
        return None
    beside = sum(np.roll(pairs, shift) for shift in (-6, -4, 4, 6)) / 4
    ratio = pairs / np.maximum(beside, 1.0)
    at = margin + int(np.argmax(ratio[margin:-margin]))
    low, high = bottom + at * width / 2, bottom + at * width / 2 + width
    inside = (readings >= low) & (readings < high)
    below = (readings < low - 0.5 * width) & (readings >= low - 2.5 * width)
    above = (readings >= high + 0.5 * width) & (readings < high + 2.5 * width)
    if min(inside.sum(), below.sum(), above.sum()) < LEAST_FRAMES:
        return None
    piled_up = 4.0 * inside.sum() / (below.sum() + above.sum())
    spread, usual = float(angles[inside].std()), float(max(angles[below].std(), angles[above].std()))
    crossed = abs(float(np.median(angles[above]) - np.median(angles[below])))
    if piled_up <= PILED_UP or spread <= SPREAD * usual or crossed < CROSSED * spread:
        return None
    extra = float(np.sqrt(spread**2 - usual**2))
    visits = np.cumsum(np.diff(inside, prepend=False) != 0)[inside]
    if extra < LEAST_EXTRA_DEG or _moves_within(visits, angles[inside]) < MOVES_SHARE * spread:
        return None
    return SaturatedBand(
        sensor, rotation, float(low), float(high), "middle", 0, extra, float(piled_up),
        spread / max(usual, 1e-9), int(inside.sum()),
        lost_deg=extra * float(np.sqrt(inside.mean())),
    )  # fmt: skip


def _moves_within(visits: np.ndarray, angles: np.ndarray) -> float:
    """Spread of angles (M,) about the mean of each of the numbered visits (M,); 0 for too few visits."""
    _, number = np.unique(visits, return_inverse=True)
    frames = np.bincount(number)
    if len(frames) < LEAST_VISITS:
        return 0.0
    means = np.bincount(number, angles) / frames
    return float(np.sqrt(np.mean((angles - means[number]) ** 2)))
