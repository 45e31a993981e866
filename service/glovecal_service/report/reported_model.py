"""A model as a report names it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from glovecal_models.calibration.model import CalibrationModel


@dataclass(frozen=True)
class ReportedModel:
    id: str
    model: CalibrationModel
    trained_on: Sequence[str] = ()
    """Ids of those takes of the report that it was trained on."""

    @property
    def name(self) -> str:
        """ "lmc_gpr 1f3a5c"."""
        return f"{self.model.method} {self.id[:6]}"
