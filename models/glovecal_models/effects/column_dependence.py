"""Dependences that no named effect explains: ``column:<sensor>`` on another sensor's reading, alone or with
the joint's own angle, and ``context:<name>`` on a recorded context column that no catalogue effect claims.

No cause is claimed, only that the error goes along with the column. Which physics lies behind it the user has
to say.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_models.effects.base.comparison import EffectComparison
from glovecal_models.effects.base.context_effect import ContextEffect
from glovecal_models.effects.base.dynamics import InstantEffect
from glovecal_models.effects.base.effect import FormSignals
from glovecal_models.effects.base.facts import About, Weights
from glovecal_models.effects.base.signals import Settings, Signals, fit_joint_units, in_joint_units

COLUMN, CONTEXT = "column:", "context:"
KNOTS = 5
PRIOR_DEG = 3.0
MOSTLY_WITHIN = 0.5
"""Share of a context column's variance inside takes above which takes need not be swapped to test it."""


class ColumnDependence(InstantEffect):
    """One for each sensor."""

    comparison = EffectComparison("circularly shifted")

    def __init__(self, column: str) -> None:
        self.column, self.name = column, COLUMN + column
        self.about = About(
            f"The error goes along with the reading of {column}; why is not known.",
            source="smooth dependence on a recorded reading; no physics is claimed",
            is_physical=False,
            shown_over="neighbour",
            neighbours=(column,),
        )

    def not_applicable_reason(self, takes: Sequence[Signals]) -> str | None:
        known = any(self.column in take.others for take in takes)
        return None if known else f"no sensor {self.column} was recorded"

    def fit_constants(self, takes: Sequence[Signals]) -> Settings:
        return fit_joint_units(takes)

    def columns(self, take: Signals, settings: Settings, shape: np.ndarray) -> np.ndarray:
        value = take.others.get(self.column, np.zeros(len(take)))
        each = np.repeat(value[:, None], take.own.shape[1], axis=1)
        return np.stack([each, each * in_joint_units(take.own, settings)], axis=2)

    def form_inputs(self, take: Signals, columns: np.ndarray, settings: Settings) -> FormSignals:
        return FormSignals({self.column: columns[:, :, 0]}, "SD")

    def weights(self, settings: Settings) -> Weights:
        return Weights((f"deg_per_sd[{self.column}]", f"deg_per_sd[{self.column} x own]"), PRIOR_DEG)


class ContextDependence(ContextEffect):
    """One for each unfamiliar context column: a smooth curve of it, straight pieces between knots, with and
    without the joint beside them."""

    def __init__(self, column: str, *, changes_within_takes: bool = False) -> None:
        self.name, self.context = CONTEXT + column, (column,)
        self.about = About(
            f"The reading changes with the recorded column c.{column}.",
            source="smooth dependence on a recorded column; no physics is claimed",
            is_physical=False,
            shown_over="context",
        )
        self.comparison = EffectComparison(
            "circularly shifted" if changes_within_takes else "context of other takes"
        )

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

    def weights(self, settings: Settings) -> Weights:
        knots = [f"{knot:.3g}[c.{self.column}]" for knot in settings["knots"]]
        gains = (f"gain_deg_per_sd_at_{knot}" for knot in knots)
        return Weights((*(f"offset_deg_at_{knot}" for knot in knots), *gains), PRIOR_DEG)


def unfamiliar_columns(takes: Sequence[Signals], familiar: Sequence[str]) -> list[str]:
    """Context columns that change and that no named effect asks for."""
    found = []
    for name in dict.fromkeys(name for take in takes for name in take.context):
        values = np.concatenate([take.context[name] for take in takes if name in take.context])
        values = values[np.isfinite(values)]
        if name not in familiar and len(values) and np.ptp(values) > 1e-9 * max(1.0, np.abs(values).max()):
            found.append(name)
    return found
