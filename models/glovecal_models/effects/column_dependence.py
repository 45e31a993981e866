"""A dependence on another sensor's reading that no named effect explains: ``column:<sensor>``.

As ``context:<name>`` is for context columns: no cause is claimed, only that the error goes along with a
reading, alone or together with the joint's own angle. Which physics lies behind it the user has to say.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from glovecal_models.effects.base.effect import InstantEffect
from glovecal_models.effects.base.facts import Control, Settings
from glovecal_models.effects.base.joint_units import fit_joint_units, in_joint_units
from glovecal_models.effects.base.signals import Signals

PREFIX = "column:"
PRIOR_DEG = 3.0


class ColumnDependence(InstantEffect):
    """One for each sensor."""

    source = "smooth dependence on a recorded reading; no physics is claimed"
    form_unit: ClassVar[str] = "SD"
    control: ClassVar[Control] = "circularly shifted"
    is_physical: ClassVar[bool] = False
    shown_over: ClassVar = "neighbour"

    def __init__(self, column: str) -> None:
        self.column = column
        self.neighbours = (column,)  # pyright: ignore[reportAttributeAccessIssue]
        self.name = PREFIX + column  # pyright: ignore[reportAttributeAccessIssue]
        self.explanation = f"The error goes along with the reading of {column}; why is not known."  # pyright: ignore[reportAttributeAccessIssue]

    def not_applicable_reason(self, takes: Sequence[Signals]) -> str | None:
        known = any(self.column in take.others for take in takes)
        return None if known else f"no sensor {self.column} was recorded"

    def fit_constants(self, takes: Sequence[Signals]) -> Settings:
        return fit_joint_units(takes)

    def grid(self, takes: Sequence[Signals], settings: Settings) -> np.ndarray:
        return np.zeros((1, takes[0].own.shape[1], 0))

    def columns(self, take: Signals, settings: Settings, shape: np.ndarray) -> np.ndarray:
        value = take.others.get(self.column, np.zeros(len(take)))
        each = np.repeat(value[:, None], take.own.shape[1], axis=1)
        return np.stack([each, each * in_joint_units(take.own, settings)], axis=2)

    def form_inputs(self, take: Signals, columns: np.ndarray, settings: Settings) -> Mapping[str, np.ndarray]:
        return {self.column: columns[:, :, 0]}

    def prior_sd(self, settings: Settings) -> np.ndarray:
        return np.full(2, PRIOR_DEG)

    def weight_names(self, settings: Settings) -> tuple[str, ...]:
        return (f"deg_per_sd[{self.column}]", f"deg_per_sd[{self.column} x own]")
