"""The calibration model of one subject and layout: a regressor for each rotation, and where it came from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.layout import Correspondence, Layout
from glovecal_models.regression.regressor import Regressor
from glovecal_models.regression.rule_regressor import RuleRegressor


@dataclass(frozen=True)
class RotationModel:
    """How one rotation is predicted, and how far that can be trusted."""

    correspondence: Correspondence
    regressor: Regressor
    input_low: np.ndarray
    """Smallest training input, shape (D,), raw counts; empty for a rule."""
    input_high: np.ndarray
    """Largest training input, shape (D,), raw counts; empty for a rule."""
    uncertain_above_deg: float
    """A standard deviation of the rotation above this is flagged "too uncertain to use"."""
    held_out_rmse_deg: float | None
    """Error on takes (or, with one take, on stretches of time) left out of training."""
    samples: int

    @property
    def rotation(self) -> str:
        return self.correspondence.rotation


@dataclass(frozen=True)
class CalibrationModel:
    """Immutable. Two models trained from the same takes with the same settings are the same bytes."""

    layout: Layout
    subject: str
    method: str
    """``linear``, ``lmc_gpr`` or ``spgp``; single rotations may be ``rule``."""
    rotations: tuple[RotationModel, ...]
    takes: tuple[str, ...]
    """sha256 of each training take's artifact (or the file's, when trained from files)."""
    parent: str | None = None
    """Model id this one was derived from."""
    error_estimate: Mapping[str, Any] = field(default_factory=dict)
    """How the held-out error was estimated, and its value over all rotations."""
    simulated: bool = False
    """True when any training take came from a simulated glove."""

    def __post_init__(self) -> None:
        names = [item.rotation for item in self.rotations]
        if len(set(names)) != len(names):
            raise BadInput(f"a calibration model must not hold a rotation twice: {names}")
        for item in self.rotations:
            rule = item.regressor
            if isinstance(rule, RuleRegressor):
                missing = set(rule.rotations) - set(names)
                if missing:
                    raise BadInput(
                        f"rule for {item.rotation} needs {sorted(missing)[0]}, which is not in the model"
                    )

    @property
    def rotation_names(self) -> tuple[str, ...]:
        return tuple(item.rotation for item in self.rotations)
