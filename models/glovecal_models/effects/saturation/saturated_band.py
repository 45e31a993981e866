"""The part of a sensor's range in which it no longer says where the joint is, and how unsure that leaves it.

Before anything is learned the whole band counts as unsure as the reference spreads in it. From errors on
held-out takes the band and its neighbours get a standard deviation for each narrow step of readings: a sensor
that flattens loses little at first and all at its end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

import numpy as np

from glovecal_models.effects.base.facts import Settings
from glovecal_models.effects.base.interval_effect import ClaimedErrors, Interval

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
