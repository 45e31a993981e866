"""Where a model fails: noise floor, what the error depends on, wearings, worst stretches; with sentences."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from glovecal_models.comparison.at_floor import is_at_floor
from glovecal_models.comparison.covariates import covariates
from glovecal_models.comparison.error_spectrum import ErrorSpectrum
from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.comparison.limits import COMPARISON_LIMITS, ComparisonLimits
from glovecal_models.comparison.residuals import Residuals
from glovecal_models.comparison.rotation_noise import RotationNoise, rotation_noise
from glovecal_models.comparison.stretches import Stretch, worst_stretches
from glovecal_models.comparison.structure import Dependence, dependence
from glovecal_models.comparison.wearings import WearingErrors, wearing_errors


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
    sentence: str
    limits: ComparisonLimits = COMPARISON_LIMITS

    @property
    def is_at_floor(self) -> bool:
        """Nothing is left to gain: noise is all there is, and it is not the prediction's own."""
        near = is_at_floor(self.rmse_deg, self.floor, self.limits)
        return near and not _is_restless(self.floor, self.limits)

    def is_structure(self, item: Dependence) -> bool:
        """Whether one of them is no noise, and large enough to matter."""
        return is_structure(item, self.rmse_deg, self.limits)

    @property
    def structure(self) -> tuple[Dependence, ...]:
        """Dependences that are no noise, the largest first."""
        return tuple(item for item in self.dependences if self.is_structure(item))


@dataclass(frozen=True)
class WhereItFails:
    """The answer for all rotations, the one farthest above its floor first."""

    rotations: tuple[RotationFindings, ...]
    stretches: tuple[Stretch, ...]

    def to_document(self) -> dict[str, Any]:
        """Plain JSON-able data; every dependence says whether it is structure."""
        rotations = []
        for item in self.rotations:
            document = asdict(item)
            for part in (document, document["wearings"] or {}):
                part.pop("limits", None)  # the same for all; nothing that was measured
            for name in ("dependences", "other_floors"):
                document[name] = list(document[name])
            for held, given in zip(document["dependences"], item.dependences, strict=True):
                held["is_structure"] = item.is_structure(given)
                for name in ("edges", "mean_deg", "count", "chance_deg"):
                    held[name] = getattr(given, name).tolist()
            rotations.append(document)
        return {"rotations": rotations, "stretches": [asdict(item) for item in self.stretches]}


def is_structure(item: Dependence, rmse_deg: float, limits: ComparisonLimits = COMPARISON_LIMITS) -> bool:
    """Whether a dependence is no noise, and large enough to matter."""
    matters = item.explained_deg**2 >= limits.structure_share * rmse_deg**2
    return item.probability <= limits.structure_p_value and matters


def where_it_fails(
    found: Residuals,
    *,
    seed: int = 0,
    noise: Mapping[str, RotationNoise] | None = None,
    limits: ComparisonLimits = COMPARISON_LIMITS,
) -> WhereItFails:
    """Every measured rotation against every column; same seed, same answer. ``noise`` spares its time."""
    generator = np.random.default_rng(seed)
    noise = rotation_noise(found, seed=seed, limits=limits) if noise is None else noise
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
    floor, slow = noise.floor, _slow_share(noise.spectrum)
    wearings = wearing_errors(found, rotation, generator, limits)
    sentence = _sentence(rotation, rmse, bias, floor, ranked, slow, limits)
    return RotationFindings(
        rotation, rmse, bias, floor, noise.floors[1:], slow, tuple(ranked), wearings, sentence, limits
    )


def _slow_share(spectrum: ErrorSpectrum | None) -> SlowShare | None:
    if spectrum is None:
        return None
    return SlowShare(spectrum.slow_share, spectrum.slow_low, spectrum.slow_high)


def _above_floor(item: RotationFindings) -> float:
    floor = item.floor.floor_deg if item.floor is not None else 0.0
    return item.rmse_deg**2 - floor**2


def _sentence(
    rotation: str,
    rmse: float,
    bias: float,
    floor: NoiseFloor | None,
    ranked: list[Dependence],
    slow: SlowShare | None,
    limits: ComparisonLimits,
) -> str:
    structure = [item for item in ranked if is_structure(item, rmse, limits)]
    start = f"{rotation} is off by {rmse:.1f} degrees"
    if floor is not None:
        least = "at least " if floor.is_lower_bound else ""
        start += f" (noise floor {least}{floor.floor_deg:.1f})"
        if is_at_floor(rmse, floor, limits):
            return f"{start}: {_at_floor(floor, limits)}."
    if abs(bias) >= limits.mostly_bias_share * rmse:
        start += f", mostly by a constant {bias:+.1f}"
    if not structure:
        slowly = "" if slow is None else f", and {100 * slow.share:.0f} % of its variance is slower than 1 Hz"
        return f"{start}; no recorded column explains it{slowly}."
    first = structure[0]
    low, high = float(np.min(first.mean_deg)), float(np.max(first.mean_deg))
    rest = len(structure) - 1
    also = f"; {rest} other column{'s' if rest > 1 else ''} too" if rest else ""
    return (
        f"{start}. It depends on {first.phrase}: from {low:+.1f} to {high:+.1f} degrees, "
        f"{first.explained_deg:.1f} in all{also}."
    )


def _is_restless(floor: NoiseFloor | None, limits: ComparisonLimits) -> bool:
    """Whether the prediction jitters by more than the reference's noise accounts for."""
    if floor is None:
        return False
    reference = np.sqrt(max(floor.floor_deg**2 - floor.prediction_deg**2, 0.0))
    return bool(floor.prediction_deg > limits.restless_times * reference)


def _at_floor(floor: NoiseFloor, limits: ComparisonLimits) -> str:
    if _is_restless(floor, limits):
        return (
            f"no more than the prediction's own jitter of {floor.prediction_deg:.1f} while the hand is "
            "still; the model follows its sensors too closely"
        )
    return "nothing is left to gain"
