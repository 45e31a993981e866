"""What became of an effect that was added to a calibration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from glovecal_models.calibration.effect_request import EffectRequest
from glovecal_models.calibration.held_out_check import HeldOutErrors
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.model_recipe import trained_rotations
from glovecal_models.effects.base.form_curve import LaneCurves
from glovecal_models.effects.base.signature_effect import LiveCheck
from glovecal_models.improvement.limits import IMPROVEMENT_LIMITS, ImprovementLimits


@dataclass(frozen=True)
class Claim:
    """Calibration of claimed standard deviations."""

    nlpd: float
    """Mean negative log predictive density, nats."""
    coverage: float
    """Share of measurements within one claimed standard deviation; expected: 0.68."""
    coverage_95: float
    """Share within 1.96 of them; expected: 0.95."""


@dataclass(frozen=True)
class ClaimCheck:
    """Before and after, on held-out takes."""

    before: Claim
    after: Claim
    limits: ImprovementLimits = IMPROVEMENT_LIMITS

    @property
    def is_truer(self) -> bool:
        return self.before.nlpd - self.after.nlpd >= self.limits.claim_least_fall_nats

    @property
    def is_no_worse(self) -> bool:
        return self.after.nlpd - self.before.nlpd <= self.limits.claim_most_rise_nats


@dataclass(frozen=True)
class Addition:
    """What became of an effect that was added."""

    effect: str
    rotations: tuple[str, ...]
    added: bool
    before: HeldOutErrors
    after: HeldOutErrors
    model: CalibrationModel
    """The child; the parent itself when the effect was undone."""
    wanted: tuple[EffectRequest, ...]
    """All effects of ``model``."""
    parameters: dict[str, dict[str, float]] = field(default_factory=dict)
    """For each rotation, units in the names."""
    left_out: tuple[str, ...] = ()
    """Rotations that were asked for, whose held-out error it raised."""
    judged: tuple[str, ...] = ()
    """Rotations whose held-out error decides."""
    least_gain: float = 0.0
    """Share of that error by which it must fall."""
    live: LiveCheck | None = None
    """How the effect acts on live frames, where it does."""
    claim: ClaimCheck | None = None
    """Of an effect that widens the interval: the claim decides instead of the error."""
    control_rmse_deg: float | None = None
    """Held-out error of the rotations with its control instead; None where there is none."""

    of_all_deg: tuple[float, float] | None = None
    """Held-out error of the model over all its rotations before and after; None where one is not known."""

    @property
    def judges_all(self) -> bool:
        """Whether the error that decides is that of all rotations, as a model's error is everywhere else."""
        return set(self.judged) >= set(trained_rotations(self.model))

    @property
    def curves(self) -> dict[str, LaneCurves]:
        """For each rotation what the learned form adds over its inputs; empty where it was undone."""
        mine = [item for item in self.model.effects if self.added and item.name == self.effect]
        found = {name: curves for item in mine for name, curves in item.curves.items()}
        return {name: curves for name, curves in found.items() if name in self.rotations}

    @property
    def control_share(self) -> float | None:
        """Of the held-out error of the rotations that the control leaves, at most 1."""
        before = total_rmse_deg(self.before, self.rotations)
        if self.control_rmse_deg is None or before <= 0:
            return None
        return min(self.control_rmse_deg / before, 1.0)

    @property
    def is_beaten_by_control(self) -> bool:
        """Whether the control, which cannot be right, leaves a smaller held-out error than the effect."""
        control = self.control_rmse_deg
        return control is not None and control < total_rmse_deg(self.after, self.rotations)

    @property
    def gain(self) -> float:
        """Share of the held-out error of the judged rotations that is gone."""
        before = total_rmse_deg(self.before, self.judged)
        return 1.0 - total_rmse_deg(self.after, self.judged) / max(before, 1e-12)


def total_rmse_deg(errors: HeldOutErrors, rotations: Sequence[str]) -> float:
    """Over all frames of ``rotations``."""
    square = sum(errors.square[name] for name in rotations)
    return float(np.sqrt(square / max(sum(errors.count[name] for name in rotations), 1)))
