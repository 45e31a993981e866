"""Where a model fails: noise floor, what the error depends on, wearings, worst stretches.

Does the error change from one wearing to the next by more than from take to take?
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from glovecal_models.comparison.dependence import covariates, dependence
from glovecal_models.comparison.error_spectrum import ErrorSpectrum
from glovecal_models.comparison.limits import COMPARISON_LIMITS, ComparisonLimits
from glovecal_models.comparison.noise_floor import RotationNoise, is_at_floor, rotation_noise
from glovecal_models.comparison.residuals import Residuals, TakeResiduals, partitions, permutations
from glovecal_models.comparison.where.answer import (
    RotationFindings,
    SlowShare,
    Stretch,
    WearingErrors,
    WhereItFails,
)

STRETCH_S = 1.0
MOST = 5


def wearing_errors(
    found: Residuals,
    rotation: str,
    generator: np.random.Generator,
    limits: ComparisonLimits = COMPARISON_LIMITS,
) -> WearingErrors | None:
    """None with fewer than two wearings in which the rotation was measured."""
    column = found.column(rotation)
    means, labels = [], []
    for item in found.takes:
        error = item.error[:, column]
        if np.isfinite(error).any():
            means.append(float(np.nanmean(error)))
            labels.append(item.take.wearing)
    names = tuple(dict.fromkeys(labels))
    if len(names) < 2:
        return None
    values, owners = np.array(means), np.array([names.index(label) for label in labels])
    each = tuple(float(values[owners == i].mean()) for i in range(len(names)))
    counts = tuple(int((owners == i).sum()) for i in range(len(names)))
    p_value = _p_value(values, owners, counts, generator, limits.wearing_fewest_deals)
    spread = float(np.std(each))
    is_significant = p_value is not None and p_value <= limits.wearing_p_value
    return WearingErrors(rotation, names, each, counts, spread, p_value, is_significant)


def _p_value(
    values: np.ndarray,
    owners: np.ndarray,
    counts: tuple[int, ...],
    generator: np.random.Generator,
    fewest: int,
) -> float | None:
    """Over distinct permutations without the true one, which random draws would repeat."""
    if partitions(counts) < fewest or min(counts) < 2:
        return None
    true = _spread(values, owners)
    others = [_spread(values, permuted) for permuted in permutations(owners, counts, generator)]
    return (1 + sum(other >= true - 1e-12 for other in others)) / (1 + len(others))


def _spread(values: np.ndarray, owners: np.ndarray) -> float:
    """Between-wearing sum of squares."""
    sums, counts = np.bincount(owners, values - values.mean()), np.bincount(owners)
    return float(np.sum(sums**2 / counts))


def where_it_fails(
    found: Residuals,
    *,
    seed: int = 0,
    noise: Mapping[str, RotationNoise] | None = None,
    limits: ComparisonLimits = COMPARISON_LIMITS,
) -> WhereItFails:
    """Every measured rotation against every column; same seed, same answer. ``noise`` spares its time."""
    generator = np.random.default_rng(seed)
    noise = rotation_noise(found, limits=limits) if noise is None else noise
    findings = [_findings(found, name, noise[name], generator, limits) for name in found.measured_rotations]
    findings.sort(key=lambda item: -_above_floor(item))
    return WhereItFails(tuple(findings), worst_stretches(found))


def _findings(
    found: Residuals,
    rotation: str,
    noise: RotationNoise,
    generator: np.random.Generator,
    limits: ComparisonLimits,
) -> RotationFindings:
    column = found.column(rotation)
    errors = tuple(item.error[:, column] for item in found.takes)
    tested = [dependence(errors, item, generator, limits) for item in covariates(found, rotation)]
    ranked = sorted((item for item in tested if item is not None), key=lambda item: -item.explained_deg)
    every = np.concatenate(errors)
    rmse, bias = float(np.sqrt(np.nanmean(every**2))), float(np.nanmean(every))
    slow = _slow_share(noise.spectrum)
    floors = [one.beside(rmse) for one in noise.floors]
    floor, others = (floors[0] if floors else None), tuple(floors[1:])
    wearings = wearing_errors(found, rotation, generator, limits)
    return _judged(
        RotationFindings(rotation, rmse, bias, floor, others, slow, tuple(ranked), wearings), limits
    )


def _slow_share(spectrum: ErrorSpectrum | None) -> SlowShare | None:
    if spectrum is None:
        return None
    return SlowShare(spectrum.slow_share, spectrum.slow_low, spectrum.slow_high)


def _above_floor(item: RotationFindings) -> float:
    floor = item.floor.floor_deg if item.floor is not None else 0.0
    return item.rmse_deg**2 - floor**2


def _judged(item: RotationFindings, limits: ComparisonLimits) -> RotationFindings:
    """With what the limits make of it."""
    floor, is_near, is_jittery, is_own = (
        item.floor,
        is_at_floor(item.rmse_deg, item.floor, limits),
        False,
        False,
    )
    if floor is not None:
        reference = np.sqrt(max(floor.floor_deg**2 - floor.prediction_deg**2, 0.0))
        # The prediction jitters by more than the reference's noise accounts for.
        is_jittery = bool(floor.prediction_deg > limits.restless_times * reference)
        most = limits.at_floor_times * float(np.hypot(floor.high_deg, floor.prediction_deg))
        is_own = is_jittery and item.rmse_deg <= most
    return replace(
        item,
        is_near_floor=is_near,
        is_at_floor=is_near and not is_jittery,
        is_own_jitter=is_own,
        is_mostly_bias=abs(item.bias_deg) >= limits.mostly_bias_share * item.rmse_deg,
    )


def worst_stretches(found: Residuals, most: int = MOST) -> tuple[Stretch, ...]:
    """Up to ``most`` stretches of about a second that do not overlap, worst first."""
    candidates = [
        stretch
        for number, item in enumerate(found.takes)
        for stretch in _stretches(number, item, found.rotations)
    ]
    candidates.sort(key=lambda stretch: -stretch.rmse_deg)
    chosen: list[Stretch] = []
    for stretch in candidates:
        if len(chosen) == most:
            break
        if all(
            stretch.number != other.number or stretch.end_s <= other.start_s or stretch.start_s >= other.end_s
            for other in chosen
        ):
            chosen.append(stretch)
    return tuple(chosen)


def windows(time: np.ndarray, length_s: float) -> Iterator[slice]:
    """Frames of windows that overlap by half; the last one ends with the recording, so that none is short."""
    if not len(time):
        return
    last = max(float(time[-1]) - length_s, float(time[0]))
    for begin in (*np.arange(time[0], last, 0.5 * length_s), last):
        first, end = np.searchsorted(time, [begin, begin + length_s])
        if end > first:
            yield slice(int(first), int(end))


def _stretches(number: int, item: TakeResiduals, rotations: tuple[str, ...]) -> list[Stretch]:
    """Stretches that overlap by half."""
    time, squared = item.take.time_s, item.error**2
    found = []
    for rows in windows(time, STRETCH_S):
        part = squared[rows]
        counted = np.isfinite(part)
        if not counted.any():
            continue
        each = np.where(counted, part, 0.0).sum(axis=0) / np.maximum(counted.sum(axis=0), 1)
        worst = int(np.argmax(each))
        middle = (rows.start + rows.stop - 1) // 2
        found.append(
            Stretch(
                take=item.take.name,
                start_s=float(time[rows.start]),
                end_s=float(time[rows.stop - 1]),
                rmse_deg=float(np.sqrt(part[counted].mean())),
                rotation=rotations[worst],
                rotation_rmse_deg=float(np.sqrt(each[worst])),
                pose=item.take.poses[middle] if item.take.poses is not None else "",
                number=number,
            )
        )
    return found
