"""Saturation: near one end of its range, or in a dead band within it, the sensor stops responding.

A curve that becomes flat looks the same as a clipped one, and what was lost is the same: inside the band the
angle is known on one side only. The interval there has to cover what the reference was seen to do.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from glovecal_models.effects.base.effect import IntervalEffect
from glovecal_models.effects.base.facts import About
from glovecal_models.effects.base.findings import (
    ClaimedErrors,
    Finding,
    Proposal,
    Recorded,
    check_signature_input,
)
from glovecal_models.effects.base.signals import Settings
from glovecal_models.effects.saturation.saturated_band import (
    SaturatedBand,
    SaturationInterval,
    saturated_bands,
)
from glovecal_models.takes.take import Take

LEAST_NOISE_SHARE, MOST_NOISE_SHARE = 0.05, 2.0


class Saturation(IntervalEffect):
    name = "saturation"
    about = About(
        "The sensor stops responding near the end of its range, or in a part of it: bending is not seen.",
        source="clipped converter or fully stretched sensor; bands: study of missing effects",
    )

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
