"""Saturation: near one end of its range, or in a dead band within it, the sensor stops responding.

Found by steps of 4 % of a sensor's range. In those at its end the reference spreads far more than it does in
a usual step, and a step holds more degrees. Where the reference rests, it is a posture. A curve that becomes
flat looks the same as a clipped one, and what was lost is the same: inside the band the angle is known on one
side only. The interval there has to cover what the reference was seen to do. A dead band is told from a hand
that rests, or a sensor that drops out to one value, by angles that differ on its two sides.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from glovecal_models.effects.base.facts import Rival, Settings
from glovecal_models.effects.base.interval_effect import ClaimedErrors, IntervalEffect
from glovecal_models.effects.base.motions import RAMPS
from glovecal_models.effects.base.signature_effect import Finding, Proposal, Recorded, check_signature_input
from glovecal_models.effects.saturation.saturated_band import SaturatedBand, SaturationInterval
from glovecal_models.takes.take import Take

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
LEAST_NOISE_SHARE, MOST_NOISE_SHARE = 0.05, 2.0


class Saturation(IntervalEffect):
    name = "saturation"
    explanation = (
        "The sensor stops responding near the end of its range, or in a part of it: bending is not seen."
    )
    source = "clipped converter or fully stretched sensor; bands: study of missing effects"
    rivals: ClassVar = (Rival("nonlinearity", RAMPS),)
    also_explained_by: ClassVar = ("cross_coupling", "hysteresis", "lag")
    also_explained_share: ClassVar = 0.35

    def find(
        self,
        takes: Sequence[Take],
        sensor_of: Mapping[str, str],
        errors: Sequence[np.ndarray] | None = None,
    ) -> tuple[Finding, ...]:
        check_signature_input(takes, sensor_of, errors)
        bands = sorted(saturated_bands(takes, sensor_of), key=lambda band: -band.extra_sd_deg)
        return tuple(_finding(band) for band in bands)

    def proposed(self, recorded: Recorded) -> Proposal | None:
        if recorded.only_held_levels:
            return None  # between two angles that are held, every step is as wide as their distance
        bands = saturated_bands(recorded.takes, recorded.sensor_of)
        where = tuple(dict.fromkeys(band.rotation for band in bands))
        return Proposal({"bands": [band.to_settings() for band in bands]}, where) if bands else None

    def learned(self, held_out: Sequence[ClaimedErrors], found: Settings) -> Settings:
        bands = [SaturatedBand.of(item) for item in found["bands"]]
        shares, learned = {}, []
        for name in dict.fromkeys(band.rotation for band in bands):
            own = [band for band in bands if band.rotation == name]
            errors = [item for item in held_out if item.rotation == name]
            shares[name] = _noise_share(own, errors)
            learned += [band.learned(errors, shares[name]).to_settings() for band in own]
        return {"bands": learned, "noise_share": shares}

    def interval(
        self, settings: Settings, rotations: Sequence[str], sensors: Sequence[str], noise: np.ndarray
    ) -> SaturationInterval:
        bands = [SaturatedBand.of(item) for item in settings["bands"]]
        shares = np.array([settings.get("noise_share", {}).get(name, 1.0) for name in rotations])
        return SaturationInterval(bands, shares, rotations, sensors, noise)

    def sentence(self, settings: Settings, rotations: Sequence[str]) -> str:
        bands = [SaturatedBand.of(item) for item in settings["bands"]]
        largest = max((max(band.step_sd_deg, default=band.extra_sd_deg) for band in bands), default=0.0)
        return (
            "no calibration brings back what the sensor does not say; near the end of its range the claimed "
            f"standard deviation is up to {largest:.1f} degrees"
        )

    def described_on(self, settings: Settings, rotation: str) -> dict[str, float]:
        told: dict[str, float] = {}
        for band in (SaturatedBand.of(item) for item in settings["bands"] if item["rotation"] == rotation):
            told |= {
                f"{band.end}_band_from_counts": band.low,
                f"{band.end}_band_to_counts": band.high,
                f"{band.end}_band_sd_deg": max(band.step_sd_deg, default=band.extra_sd_deg),
            }
        return told


def _near(band: SaturatedBand, held_out: ClaimedErrors) -> np.ndarray:
    return band.is_near(held_out.readings[:, held_out.sensors.index(band.sensor)])


def _noise_share(bands: Sequence[SaturatedBand], held_out: Sequence[ClaimedErrors]) -> float:
    """How much of the noise that training found is there far from the bands: it took the loss for noise."""
    square, known, noise = 0.0, 0.0, 0.0
    for item in held_out:
        far = ~np.any([_near(band, item) for band in bands], axis=0)
        square += float(np.sum(item.error[far] ** 2))
        known += float(np.sum(item.variance[far] - item.noise))
        noise += float(far.sum() * item.noise)
    share = (square - known) / noise if noise > 0 else 1.0
    return float(np.clip(share, LEAST_NOISE_SHARE, MOST_NOISE_SHARE))


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
    towards = 1 if np.median(angles[end]) >= np.median(angles[beside]) else -1
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


def _finding(band: SaturatedBand) -> Finding:
    side = {
        "high": f"from {band.low:.4g} upwards",
        "low": f"from {band.high:.4g} downwards",
        "middle": f"between {band.low:.4g} and {band.high:.4g}",
    }[band.end]
    sentence = (
        f"{band.sensor}: the sensor stops responding here, {side}; {band.rotation} spreads by "
        f"{band.extra_sd_deg:.1f} deg there unseen. Nothing brings it back; the interval becomes wider."
    )
    evidence = {
        "density_over_next_bands_1": band.piled_up,
        "reference_spread_over_usual_1": band.spread_ratio,
        "band_low_counts": band.low,
        "band_high_counts": band.high,
    }
    return Finding(
        Saturation.name, (band.sensor,), sentence, kind=band.end, size_deg=band.extra_sd_deg,
        count=band.frames, evidence=evidence, error_square=band.lost_deg**2,
    )  # fmt: skip
