"""Where a model fails: noise floor, what the error depends on, wearings, worst stretches."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from glovecal_models.comparison.dependence import Dependence, covariates, dependence
from glovecal_models.comparison.error_spectrum import ErrorSpectrum
from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.comparison.limits import COMPARISON_LIMITS, ComparisonLimits
from glovecal_models.comparison.noise_floor import RotationNoise, is_at_floor, rotation_noise
from glovecal_models.comparison.residuals import Residuals, TakeResiduals
from glovecal_models.comparison.wearings import WearingErrors, wearing_errors

STRETCH_S = 1.0
MOST = 5


@dataclass(frozen=True)
class SlowShare:
    """Share of an error's variance below 1 Hz, with its 95 % interval."""

    share: float
    low: float
    high: float


@dataclass(frozen=True)
class RotationFindings:
    """One rotation: how far from its floor, and what its error depends on."""

    rotation: str
    rmse_deg: float
    bias_deg: float
    floor: NoiseFloor | None
    other_floors: tuple[NoiseFloor, ...]
    """Less good estimates of the floor."""
    slow: SlowShare | None
    """None: too little was measured without a gap."""
    dependences: tuple[Dependence, ...]
    """Every column tested, the one that explains most first."""
    wearings: WearingErrors | None
    limits: ComparisonLimits = COMPARISON_LIMITS

    @property
    def is_near_floor(self) -> bool:
        """The error is no larger than the noise floor, within its interval."""
        return is_at_floor(self.rmse_deg, self.floor, self.limits)

    @property
    def is_jittery(self) -> bool:
        """The prediction jitters by more than the reference's noise accounts for."""
        return _is_jittery(self.floor, self.limits)

    @property
    def is_own_jitter(self) -> bool:
        """The error is no larger than the noise floor and the prediction's own jitter together."""
        if self.floor is None or not self.is_jittery:
            return False
        most = float(np.hypot(self.floor.high_deg, self.floor.prediction_deg))
        return self.rmse_deg <= self.limits.at_floor_times * most

    @property
    def times_floor(self) -> float | None:
        """The error over its noise floor; None where that is unknown, not reliable or a lower bound."""
        floor = self.floor
        if floor is None or floor.is_lower_bound or not floor.is_reliable or floor.floor_deg <= 0:
            return None
        return self.rmse_deg / floor.floor_deg

    @property
    def is_at_floor(self) -> bool:
        """Only noise remains, and it is not the prediction's own."""
        return self.is_near_floor and not self.is_jittery

    def is_structure(self, item: Dependence) -> bool:
        """Whether one of them is significant, and large enough to matter."""
        return is_structure(item, self.rmse_deg, self.limits)

    @property
    def structure(self) -> tuple[Dependence, ...]:
        """Significant dependences, the largest first."""
        return tuple(item for item in self.dependences if self.is_structure(item))


@dataclass(frozen=True)
class WhereItFails:
    """The answer for all rotations, the one farthest above its floor first."""

    rotations: tuple[RotationFindings, ...]
    stretches: tuple[Stretch, ...]


def is_structure(item: Dependence, rmse_deg: float, limits: ComparisonLimits = COMPARISON_LIMITS) -> bool:
    """Whether a dependence is significant, and large enough to matter."""
    matters = item.explained_deg**2 >= limits.structure_share * rmse_deg**2
    return item.p_value <= limits.structure_p_value and matters


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
    tested = [dependence(errors, covariate, generator) for covariate in covariates(found, rotation)]
    ranked = sorted((item for item in tested if item is not None), key=lambda item: -item.explained_deg)
    every = np.concatenate(errors)
    rmse, bias = float(np.sqrt(np.nanmean(every**2))), float(np.nanmean(every))
    slow = _slow_share(noise.spectrum)
    floors = [one.beside(rmse) for one in noise.floors]
    floor, others = (floors[0] if floors else None), tuple(floors[1:])
    wearings = wearing_errors(found, rotation, generator, limits)
    return RotationFindings(rotation, rmse, bias, floor, others, slow, tuple(ranked), wearings, limits)


def _slow_share(spectrum: ErrorSpectrum | None) -> SlowShare | None:
    if spectrum is None:
        return None
    return SlowShare(spectrum.slow_share, spectrum.slow_low, spectrum.slow_high)


def _above_floor(item: RotationFindings) -> float:
    floor = item.floor.floor_deg if item.floor is not None else 0.0
    return item.rmse_deg**2 - floor**2


def _is_jittery(floor: NoiseFloor | None, limits: ComparisonLimits) -> bool:
    """Whether the prediction jitters by more than the reference's noise accounts for."""
    if floor is None:
        return False
    reference = np.sqrt(max(floor.floor_deg**2 - floor.prediction_deg**2, 0.0))
    return bool(floor.prediction_deg > limits.restless_times * reference)


@dataclass(frozen=True)
class Stretch:
    """One stretch of a take; errors over the rotations measured in it, degrees."""

    take: str
    start_s: float
    end_s: float
    """Seconds on the take's own clock."""
    rmse_deg: float
    rotation: str
    """The rotation that is worst in it."""
    rotation_rmse_deg: float
    pose: str
    """What the take calls the pose in its middle, "" for nothing."""
    number: int
    """Of the take among those given, as two may have one name."""


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
