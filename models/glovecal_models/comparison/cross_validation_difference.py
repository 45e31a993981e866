"""Two calibrations from disjoint halves of the recordings, compared posture by posture.

Where two models that saw different wearings (or, with one wearing, different takes) differ by no more than
the root of their summed claimed variances, noise explains the difference. Where they differ by much more the
model is wrong there: its form, or something that it is not told. (mrcal compares camera calibrations so,
from disjoint sets of images: https://mrcal.secretsauce.net/tour-cross-validation.html.)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.calibration.effect_correction import EffectCorrection
from glovecal_models.calibration.effect_fit import EffectFit, correspondence_for, fit_with_effects
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.model_recipe import (
    repaired_takes,
    requested_effects,
    settings_of,
    trained_rotations,
)
from glovecal_models.calibration.prepared_takes import PreparedTakes
from glovecal_models.calibration.training_settings import TrainingSettings, left_out_settings
from glovecal_models.comparison.limits import COMPARISON_LIMITS, ComparisonLimits
from glovecal_models.errors import NotTrainable
from glovecal_models.progress import Cancel
from glovecal_models.takes.take import Take

ROWS_AT_MOST = 4000
REGIONS = 6
FEWEST_TAKES_OF_A_HALF = 2
"""In a half; one take alone rarely covers the postures of the others."""
FEWEST_ROWS_OF_A_REGION = 30
"""In a region; fewer say nothing."""


@dataclass(frozen=True)
class RegionDifference:
    """One rotation in one range of its angle."""

    rotation: str
    low_deg: float
    high_deg: float
    difference_deg: float
    """RMS difference of the two models' predictions."""
    claimed_deg: float
    """Root of their summed claimed variances, RMS."""
    limits: ComparisonLimits = COMPARISON_LIMITS

    @property
    def ratio(self) -> float:
        return self.difference_deg / self.claimed_deg

    @property
    def is_significant(self) -> bool:
        """Whether the model, not the noise, is wrong there."""
        return self.ratio > self.limits.cross_validation_ratio


@dataclass(frozen=True)
class CrossValidationDifference:
    """All regions, the largest ratio first."""

    halves: tuple[tuple[str, ...], tuple[str, ...]]
    """Wearings, or takes, of the two models."""
    are_wearings: bool
    regions: tuple[RegionDifference, ...]


def cross_validation_difference(
    model: CalibrationModel,
    takes: Sequence[Take],
    settings: TrainingSettings | None = None,
    *,
    limits: ComparisonLimits = COMPARISON_LIMITS,
    cancelled: Cancel | None = None,
) -> CrossValidationDifference | None:
    """``model`` trained again on each half of its training ``takes``; None for fewer than two takes in a
    half, or where a half cannot carry a model. Raises Cancelled."""
    wanted = requested_effects(model)
    prepared = PreparedTakes.of(repaired_takes(takes, wanted), model.layout)
    wearings = [take.wearing for take in takes]
    are_wearings = len(set(wearings)) > 1
    owners = wearings if are_wearings else [f"{take.name} ({at + 1})" for at, take in enumerate(takes)]
    names = list(dict.fromkeys(owners))
    halves = (tuple(names[0::2]), tuple(names[1::2]))
    if any(sum(owner in half for owner in owners) < FEWEST_TAKES_OF_A_HALF for half in halves):
        return None
    settings, rotations = left_out_settings(settings_of(model, settings)), trained_rotations(model)
    try:
        fits = [
            fit_with_effects(
                prepared.some([at for at, name in enumerate(owners) if name in half]),
                rotations, wanted, settings, cancelled=cancelled,
            )
            for half in halves
        ]  # fmt: skip
    except NotTrainable:
        return None
    first, second = (_predicted(fit, prepared, rotations, settings) for fit in fits)
    known = model.unseen_wearing
    between = known.between_sd_deg if known is not None and are_wearings else {}
    regions = _regions(rotations, first, second, between, limits)
    return CrossValidationDifference(halves, are_wearings, tuple(regions))


def _predicted(
    fit: EffectFit, takes: PreparedTakes, rotations: Sequence[str], settings: TrainingSettings
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and claimed variance (N, R) at frames of all takes, evenly spread; degrees, degrees squared.

    Every take is predicted as of a wearing that nobody named: a half must not know the other's wearings.
    """
    regressors = [fit.regressor(name) for name in rotations]
    noise = np.array([regressor.noise_variance for regressor in regressors])
    inputs = [takes.inputs(correspondence_for(takes, name, settings)) for name in rotations]
    correction = EffectCorrection(fit.effects, list(rotations), takes.scale)
    step = max(1, sum(len(take.time_s) for take in takes.takes) // ROWS_AT_MOST)
    means, variances = [], []
    for number, take in enumerate(takes.takes):
        parts = [regressor.predict(each[number]) for regressor, each in zip(regressors, inputs, strict=True)]
        base = np.column_stack([part.mean for part in parts])
        added = correction.of_take(take.time_s, base, takes.readings[number], take.context, "").degrees
        means.append((base + added)[::step])
        variances.append((np.column_stack([part.variance for part in parts]) + noise)[::step])
    return np.concatenate(means), np.concatenate(variances)


def _regions(
    rotations: Sequence[str],
    first: tuple[np.ndarray, np.ndarray],
    second: tuple[np.ndarray, np.ndarray],
    between: Mapping[str, float],
    limits: ComparisonLimits,
) -> list[RegionDifference]:
    """Of each rotation in equal ranges of its predicted angle, the largest ratio first."""
    found = []
    for column, name in enumerate(rotations):
        a, b = first[0][:, column], second[0][:, column]
        claimed = first[1][:, column] + second[1][:, column] + 2 * between.get(name, 0.0) ** 2
        angle = (a + b) / 2
        low_end, high_end = np.percentile(angle, [1, 99]).tolist()
        edges = np.linspace(low_end, high_end, REGIONS + 1)
        for low, high in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
            rows = (angle >= low) & (angle <= high)
            if rows.sum() >= FEWEST_ROWS_OF_A_REGION:
                difference = float(np.sqrt(np.mean((a[rows] - b[rows]) ** 2)))
                sd = float(np.sqrt(np.mean(claimed[rows])))
                found.append(RegionDifference(name, low, high, difference, sd, limits))
    return sorted(found, key=lambda item: -item.ratio)
