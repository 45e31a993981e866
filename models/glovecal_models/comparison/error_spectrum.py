"""How an error is spread over slow and fast: what share of it is slow, and what is left at high frequencies.

The error is cut into blocks of a few seconds. Physical effects that a model misses are slow: they follow the
hand, the warmth, the wearing. Noise of sensor and reference goes on to the highest frequencies; there the
spectrum has a plateau, and a plateau over all frequencies would be the white part of the noise. It is a
lower bound of the noise floor: noise with a memory is not in it.

Frames are taken as evenly spaced; blocks do not cross gaps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.comparison.floor_estimate import RESAMPLES, NoiseFloor, pooled
from glovecal_models.comparison.limits import COMPARISON_LIMITS, ComparisonLimits
from glovecal_models.comparison.residuals import Residuals, TakeResiduals

SLOW_HZ = 1.0
BLOCK_S = 4.0
SHORTEST_BLOCK = 32
"""Frames; with fewer the plateau cannot be told from the rest."""
GAP = 3.0
"""Times the usual time between frames: what is longer is a gap."""


@dataclass(frozen=True)
class ErrorSpectrum:
    """The spectrum of one rotation's error about its mean."""

    frequency_hz: np.ndarray
    """(F,)."""
    density: np.ndarray
    """(F,), degrees squared per hertz, the mean over the blocks."""
    slow_share: float
    """Share of the error's variance below ``SLOW_HZ``, with its 95 % interval."""
    slow_low: float
    slow_high: float
    plateau: NoiseFloor
    """The noise floor that the highest frequencies show."""
    plateau_density: float
    """The same as a height in ``density``."""


def error_spectrum(
    found: Residuals,
    rotation: str,
    generator: np.random.Generator,
    limits: ComparisonLimits = COMPARISON_LIMITS,
) -> ErrorSpectrum | None:
    """None when fewer than ``fewest_spectrum_blocks`` blocks were measured without a gap."""
    column = found.column(rotation)
    mean = float(np.nanmean(found.stacked("error")[:, column]))
    blocks = [block for item in found.takes for block in _blocks(item, column, mean)]
    if len(blocks) < limits.fewest_spectrum_blocks:
        return None
    shares = np.array([(np.mean(block.slow**2), np.mean(block.error**2)) for block in blocks])
    slow, low, high = _share(shares, generator)
    errors, predicted = (_periodograms([getattr(b, name) for b in blocks]) for name in ("error", "predicted"))
    squares = np.array([_plateau(heights) for heights in errors])
    jitter = float(np.sqrt(np.mean([_plateau(heights) for heights in predicted])))
    floor = pooled(squares, np.ones(len(squares)), jitter, "spectrum", generator)
    count = min(len(block.error) // 2 for block in blocks)
    densities = [2.0 / b.rate_hz * heights[1 : count + 1] for b, heights in zip(blocks, errors, strict=True)]
    return ErrorSpectrum(
        frequency_hz=np.arange(1, count + 1) / BLOCK_S,
        density=np.mean(densities, axis=0),
        slow_share=slow, slow_low=low, slow_high=high, plateau=floor,
        plateau_density=float(np.mean([2.0 * p / b.rate_hz for p, b in zip(squares, blocks, strict=True)])),
    )  # fmt: skip


@dataclass(frozen=True)
class _Block:
    rate_hz: float
    error: np.ndarray
    """About the mean of the rotation's errors."""
    slow: np.ndarray
    """The part of it below ``SLOW_HZ``."""
    predicted: np.ndarray


def _blocks(item: TakeResiduals, column: int, mean: float) -> list[_Block]:
    time, error = item.take.time_s, item.error[:, column] - mean
    if len(time) < SHORTEST_BLOCK:
        return []
    step = float(np.median(np.diff(time)))
    length = round(BLOCK_S / step)
    if length < SHORTEST_BLOCK:
        return []
    known = np.flatnonzero(np.isfinite(error))
    breaks = np.flatnonzero((np.diff(known) > 1) | (np.diff(time[known]) > GAP * step)) + 1
    found = []
    for run in np.split(known, breaks):
        slow = _slow_part(error[run], 1.0 / step)
        for start in range(0, len(run) - length + 1, length):
            part = slice(start, start + length)
            rows = run[part]
            found.append(_Block(1.0 / step, error[rows], slow[part], item.predicted[rows, column]))
    return found


def _slow_part(values: np.ndarray, rate_hz: float) -> np.ndarray:
    """By the cosine transform: it mirrors the series at its ends, so that they do not look fast."""
    if not len(values):
        return values
    from scipy.fft import dct, idct  # slow to load, and every service loads this file

    frequency = 0.5 * rate_hz * np.arange(len(values)) / len(values)
    coefficients = np.asarray(dct(values, norm="ortho"))
    return np.asarray(idct(np.where(frequency < SLOW_HZ, coefficients, 0.0), norm="ortho"))


def _share(shares: np.ndarray, generator: np.random.Generator) -> tuple[float, float, float]:
    slow, every = shares.sum(axis=0)
    if every <= 0:
        return 0.0, 0.0, 0.0
    drawn = shares[generator.integers(0, len(shares), (RESAMPLES, len(shares)))].sum(axis=1)
    low, high = np.percentile(drawn[:, 0] / np.maximum(drawn[:, 1], 1e-300), [2.5, 97.5])
    return float(slow / every), float(low), float(high)


def _periodograms(blocks: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Of white noise its variance, at every frequency; tapered, so that what is slow stays slow."""
    found: dict[int, np.ndarray] = {}
    lengths = [len(block) for block in blocks]
    for length in set(lengths):
        taper = np.hanning(length)
        alike = _detrended(np.array([block for block in blocks if len(block) == length]))
        of_length = iter(np.abs(np.fft.rfft(alike * taper, axis=1)) ** 2 / float(taper @ taper))
        found |= {number: next(of_length) for number, other in enumerate(lengths) if other == length}
    return [found[number] for number in range(len(blocks))]


def _detrended(values: np.ndarray) -> np.ndarray:
    """Rows (B, N) without their least-squares lines."""
    time = np.arange(values.shape[1]) - (values.shape[1] - 1) / 2
    slope = values @ time / (time @ time)
    return values - values.mean(axis=1, keepdims=True) - slope[:, None] * time


def _plateau(heights: np.ndarray) -> float:
    """Variance of the white noise that the upper half of the frequencies shows, by their median."""
    half = len(heights) - 1
    return float(np.median(heights[half // 2 : half])) / np.log(2.0)
