"""Saturation: near one end of its range the sensor stops responding.

Found by bands of 4 % of a sensor's range. In the end band readings pile up, and the reference there spreads
more than one band's worth of angles. Where the reference rests too, it is a posture. A curve that becomes
flat looks the same as a clipped one, and what was lost is the same: inside the band the angle is known on one
side only.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Literal

import numpy as np

from glovecal_models.effects.effect import Settings
from glovecal_models.effects.signature_effect import Finding, SignatureEffect, check_signature_input
from glovecal_models.takes.take import Take

BAND = 0.04
PILED_UP = 3.0
SPREAD = 2.0
LEAST_FRAMES = 30
LEAST_VISITS = 4
MOVES_SHARE = 0.25
"""Of the reference's spread in the band, to be seen within visits to it: else the hand only rested there."""
LEAST_EXTRA_DEG = 2.0
"""A smaller loss is not worth a word."""


@dataclass(frozen=True)
class SaturatedBand:
    """Readings between which a sensor no longer says where the joint is."""

    sensor: str
    rotation: str
    low: float
    high: float
    """Raw readings; the open end is the sensor's own."""
    end: Literal["low", "high"]
    towards: int
    """+1 when the true angle may be larger than predicted, -1 when smaller."""
    extra_sd_deg: float
    """What the reference spreads in the band beyond what it does in the next one."""
    piled_up: float
    """Density of readings in the band over that of the next two."""
    spread_ratio: float
    frames: int

    def extra_sd(self, readings: np.ndarray) -> np.ndarray:
        """(N,) degrees to be added (in squares) to the standard deviation, on the side ``towards``."""
        inside = readings >= self.low if self.end == "high" else readings <= self.high
        return np.where(inside, self.extra_sd_deg, 0.0)

    def censored_interval(
        self, readings: np.ndarray, predicted_deg: np.ndarray, sd_deg: np.ndarray, times: float = 1.0
    ) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper angle (N,), ``times`` standard deviations away; one-sidedly wider in the band."""
        wide = np.hypot(sd_deg, self.extra_sd(readings))
        below, above = (sd_deg, wide) if self.towards > 0 else (wide, sd_deg)
        return predicted_deg - times * below, predicted_deg + times * above

    def to_settings(self) -> Settings:
        """Plain JSON-able data; ``SaturatedBand(**settings)`` reads it back."""
        return asdict(self)


class Saturation(SignatureEffect):
    name = "saturation"
    explanation = "The sensor stops responding near the end of its range: further bending is not seen."
    source = "clipped converter or fully stretched sensor; bands: study of missing effects"

    def find(
        self,
        takes: Sequence[Take],
        sensor_of: Mapping[str, str],
        errors: Sequence[np.ndarray] | None = None,
    ) -> tuple[Finding, ...]:
        check_signature_input(takes, sensor_of, errors)
        bands = sorted(saturated_bands(takes, sensor_of), key=lambda band: -band.extra_sd_deg)
        return tuple(_finding(band) for band in bands)


def saturated_bands(takes: Sequence[Take], sensor_of: Mapping[str, str]) -> tuple[SaturatedBand, ...]:
    """The bands in which sensors stop responding, at most two for each rotation."""
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
    end, following = value >= top - width, (value < top - width) & (value >= top - 2 * width)
    neighbours = (value < top - width) & (value >= top - 3 * width)
    # With few readings beside it, a pile tells nothing of what the sensor does on its way there.
    if end.sum() < LEAST_FRAMES or neighbours.sum() < LEAST_FRAMES:
        return None
    piled_up = 2.0 * end.sum() / neighbours.sum()
    beside = following if following.sum() >= LEAST_FRAMES else neighbours
    spread, usual = float(angles[end].std()), float(angles[beside].std())
    if piled_up <= PILED_UP or spread <= SPREAD * usual:
        return None
    extra = float(np.sqrt(spread**2 - usual**2))
    visits = np.cumsum(np.diff(end, prepend=False) != 0)[end]
    if extra < LEAST_EXTRA_DEG or _moves_within(visits, angles[end]) < MOVES_SHARE * spread:
        return None
    towards = 1 if np.median(angles[end]) >= np.median(angles[beside]) else -1
    edges = sorted((sign * (top - width), sign * max(float(value.max()), float(top))))
    return SaturatedBand(
        sensor, rotation, float(edges[0]), float(edges[1]), "high" if sign > 0 else "low", towards, extra,
        float(piled_up), spread / max(usual, 1e-9), int(end.sum()),
    )  # fmt: skip


def _moves_within(visits: np.ndarray, angles: np.ndarray) -> float:
    """Spread of angles (M,) about the mean of each of the numbered visits (M,); 0 for too few visits."""
    _, number = np.unique(visits, return_inverse=True)
    frames = np.bincount(number)
    if len(frames) < LEAST_VISITS:
        return 0.0
    means = np.bincount(number, angles) / frames
    return float(np.sqrt(np.mean((angles - means[number]) ** 2)))


def _finding(band: SaturatedBand) -> Finding:
    side = f"from {band.low:.4g} upwards" if band.end == "high" else f"from {band.high:.4g} downwards"
    sentence = (
        f"{band.sensor}: the sensor stops responding here, {side}; {band.rotation} spreads by "
        f"{band.extra_sd_deg:.1f} deg there unseen. Nothing brings it back; the interval becomes wider."
    )
    evidence = {
        "density_over_next_bands_1": band.piled_up,
        "reference_spread_over_next_band_1": band.spread_ratio,
        "band_low_counts": band.low,
        "band_high_counts": band.high,
    }
    return Finding(
        Saturation.name, (band.sensor,), sentence, kind=band.end, size_deg=band.extra_sd_deg,
        count=band.frames, evidence=evidence,
    )  # fmt: skip
