"""A dependence on a recorded context column that no catalogue effect claims: ``context:<name>``.

Not a named cause, only a smooth curve of that column: straight pieces between knots, with and without the
joint beside them. Which physics lies behind it the user has to say.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from glovecal_models.effects.base.context_effect import ContextEffect
from glovecal_models.effects.base.facts import Control, Settings
from glovecal_models.effects.base.signals import Signals

PREFIX = "context:"
KNOTS = 5
PRIOR_DEG = 3.0
MOSTLY_WITHIN = 0.5
"""Share of a column's variance inside takes above which takes need not be swapped to test it."""


class ContextDependence(ContextEffect):
    """One for each unfamiliar column."""

    is_physical: ClassVar[bool] = False

    source = "smooth dependence on a recorded column; no physics is claimed"

    def __init__(self, column: str, *, changes_within_takes: bool = False) -> None:
        self.name = PREFIX + column  # pyright: ignore[reportAttributeAccessIssue]
        self.context = (column,)  # pyright: ignore[reportAttributeAccessIssue]
        self.explanation = f"The reading changes with the recorded column c.{column}."  # pyright: ignore[reportAttributeAccessIssue]
        self.control: Control = "circularly shifted" if changes_within_takes else "context of other takes"  # pyright: ignore[reportIncompatibleVariableOverride]

    @classmethod
    def of(cls, column: str, takes: Sequence[Signals]) -> ContextDependence:
        """With the control that suits how the column changes."""
        known = [take.context[column] for take in takes if column in take.context]
        known = [part[np.isfinite(part)] for part in known]
        known = [part for part in known if len(part)]
        within = sum(float(np.sum((part - part.mean()) ** 2)) for part in known)
        every = np.concatenate(known) if known else np.zeros(1)
        total = float(np.sum((every - every.mean()) ** 2))
        return cls(column, changes_within_takes=within > MOSTLY_WITHIN * total)

    def fit_constants(self, takes: Sequence[Signals]) -> Settings:
        settings = super().fit_constants(takes)
        values = np.concatenate([take.context[self.column] for take in takes if self.column in take.context])
        values = values[np.isfinite(values)]
        knots = np.unique(np.quantile(values, np.linspace(0, 1, KNOTS)))
        return settings | {"knots": knots.tolist()}

    def functions(self, value: np.ndarray, settings: Settings, shape: np.ndarray) -> np.ndarray:
        knots = np.array(settings["knots"])
        hats = np.column_stack([np.interp(value, knots, row) for row in np.eye(len(knots))])
        usual = np.array([np.interp(settings["usual"], knots, row) for row in np.eye(len(knots))])
        return np.repeat((hats - usual)[:, None, :], len(shape), axis=1)

    def prior_sd(self, settings: Settings) -> np.ndarray:
        return np.full(2 * len(settings["knots"]), PRIOR_DEG)

    def weight_names(self, settings: Settings) -> tuple[str, ...]:
        knots = [f"{knot:.3g}[c.{self.column}]" for knot in settings["knots"]]
        return (
            *(f"offset_deg_at_{knot}" for knot in knots),
            *(f"gain_deg_per_sd_at_{knot}" for knot in knots),
        )


def unfamiliar_columns(takes: Sequence[Signals], familiar: Sequence[str]) -> list[str]:
    """Context columns that change and that no named effect asks for."""
    found = []
    for name in dict.fromkeys(name for take in takes for name in take.context):
        values = np.concatenate([take.context[name] for take in takes if name in take.context])
        values = values[np.isfinite(values)]
        if name not in familiar and len(values) and np.ptp(values) > 1e-9 * max(1.0, np.abs(values).max()):
            found.append(name)
    return found
