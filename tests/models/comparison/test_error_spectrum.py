"""The error's spectrum: the white part is found under slow errors, and the slow share is what was planted."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from glovecal_models.comparison.error_spectrum import ErrorSpectrum, error_spectrum
from glovecal_models.comparison.residuals import Residuals, TakeResiduals

RATE_HZ = 60.0


@pytest.fixture
def spectrum(
    take_residuals: Callable[..., TakeResiduals], together: Callable[..., Residuals]
) -> Callable[..., ErrorSpectrum | None]:
    def make(*errors: np.ndarray) -> ErrorSpectrum | None:
        takes = [take_residuals(np.zeros(len(error)), error, np.zeros(len(error))) for error in errors]
        return error_spectrum(together(*takes), "A", np.random.default_rng(1))

    return make


def test_white_noise_is_all_plateau(spectrum: Callable[..., ErrorSpectrum]) -> None:
    error = 0.7 * np.random.default_rng(2).normal(size=7200) + 5.0
    found = spectrum(error)
    assert found.plateau.floor_deg == pytest.approx(0.7, rel=0.05)
    assert found.plateau.low_deg < 0.7 < found.plateau.high_deg
    assert found.plateau.is_lower_bound
    assert found.slow_low < 1 / 30 < found.slow_high  # 1 of 30 hertz; the constant is no part of it
    assert found.plateau_density == pytest.approx(np.mean(found.density), rel=0.1)
    assert np.sum(found.density) * found.frequency_hz[0] == pytest.approx(0.49, rel=0.1)


@pytest.mark.parametrize("hertz", [0.05, 0.4, 0.8])
def test_a_slow_error_does_not_reach_the_plateau(
    spectrum: Callable[..., ErrorSpectrum], hertz: float
) -> None:
    time = np.arange(7200) / RATE_HZ
    slow = 3.0 * np.sin(2 * np.pi * hertz * time + 1.0)
    found = spectrum(slow + 0.5 * np.random.default_rng(3).normal(size=len(time)))
    assert found.plateau.floor_deg == pytest.approx(0.5, rel=0.08)
    assert found.slow_share == pytest.approx(4.5 / 4.75, abs=0.03)


def test_a_fast_error_is_not_called_slow(spectrum: Callable[..., ErrorSpectrum]) -> None:
    time = np.arange(7200) / RATE_HZ
    found = spectrum(3.0 * np.sin(2 * np.pi * 2.5 * time) + 0.5 * np.random.default_rng(4).normal(size=7200))
    assert found.slow_share < 0.05
    assert found.frequency_hz[np.argmax(found.density)] == pytest.approx(2.5)


def test_takes_that_differ_are_slow(spectrum: Callable[..., ErrorSpectrum]) -> None:
    generator = np.random.default_rng(5)
    found = spectrum(*(offset + 0.3 * generator.normal(size=1200) for offset in (-2.0, 2.0)))
    assert found.slow_share > 0.95


def test_gaps_break_blocks_and_too_few_blocks_give_none(
    spectrum: Callable[..., ErrorSpectrum | None],
) -> None:
    error = np.random.default_rng(6).normal(size=1200)
    assert spectrum(error) is not None
    error[::200] = np.nan  # 199 frames in a row are less than a block of 4 s
    assert spectrum(error) is None
