"""What is noise in each rotation's error: the floors, and how slow the rest is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from glovecal_models.comparison.error_spectrum import ErrorSpectrum, error_spectrum
from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.comparison.limits import COMPARISON_LIMITS, ComparisonLimits
from glovecal_models.comparison.noise_floor import noise_floors
from glovecal_models.comparison.residuals import Residuals


@dataclass(frozen=True)
class RotationNoise:
    floors: tuple[NoiseFloor, ...]
    """Every estimate that the takes allow, the best first."""
    spectrum: ErrorSpectrum | None

    @property
    def floor(self) -> NoiseFloor | None:
        """The best estimate."""
        return self.floors[0] if self.floors else None


def rotation_noise(
    found: Residuals, *, seed: int = 0, limits: ComparisonLimits = COMPARISON_LIMITS
) -> dict[str, RotationNoise]:
    """Of every measured rotation. A rotation's intervals do not depend on which others were measured."""
    result = {}
    for rotation in found.measured_rotations:
        generator = np.random.default_rng([seed, *rotation.encode()])
        spectrum = error_spectrum(found, rotation, generator, limits)
        floors = noise_floors(found, rotation, generator, spectrum, limits)
        result[rotation] = RotationNoise(floors, spectrum)
    return result
