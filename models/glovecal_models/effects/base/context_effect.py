"""Effects of a recorded context column: an offset and a gain that change with it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from glovecal_models.effects.base.column_steps import IN_STEPS, ColumnSteps
from glovecal_models.effects.base.effect import InstantEffect
from glovecal_models.effects.base.facts import Control, Settings, ShownOver
from glovecal_models.effects.base.joint_units import fit_joint_units, in_joint_units
from glovecal_models.effects.base.signals import Signals

PRIOR_DEG = 4.0
SQUARE_PRIOR_DEG = 6.0
BEYOND_SHARE = 0.3
"""Of the range seen in training: so far a slope goes on, for the next take is seldom inside all others."""


class ContextEffect(InstantEffect):
    """Columns h and h x joint, h a function of one context column, zero at that column's usual value.

    Well outside the range seen in training the column is held: no far extrapolation.
    """

    control: ClassVar[Control] = "context of other takes"
    has_any_form: ClassVar[bool] = False
    """Whether the error may follow the column, which changes between takes, in any smooth form."""
    may_act_in_steps: ClassVar[bool] = False
    """Whether firmware may correct it by a table of the column (``column_steps``)."""
    shown_over: ClassVar[ShownOver] = "context"

    @property
    def column(self) -> str:
        return self.context[0]

    def fit_constants(self, takes: Sequence[Signals]) -> Settings:
        values = np.concatenate([take.context[self.column] for take in takes if self.column in take.context])
        values = values[np.isfinite(values)]
        return {
            "low": float(values.min()),
            "high": float(values.max()),
            "usual": float(np.median(values)),
            **fit_joint_units(takes),
        }

    def settings_with_found(self, settings: Settings, stored: Settings) -> Settings:
        steps = ColumnSteps.of_settings(stored)
        return settings if steps is None else {**settings, **steps.to_settings()}

    def settings_as_stored(self, takes: Sequence[Signals], settings: Settings, stored: Settings) -> Settings:
        return self.settings_with_found(settings, stored)

    def grid(self, takes: Sequence[Signals], settings: Settings) -> np.ndarray:
        return np.zeros((1, takes[0].own.shape[1], 0))

    def columns(self, take: Signals, settings: Settings, shape: np.ndarray) -> np.ndarray:
        offsets = self.functions(self.clipped(take, settings), settings, shape)
        joint = in_joint_units(take.own, settings)[:, :, None]
        return np.concatenate([offsets, offsets * joint], axis=2)

    def clipped(self, take: Signals, settings: Settings) -> np.ndarray:
        """The context column (N,), its usual value where unknown, held near what training saw."""
        value = take.context.get(self.column)
        value = np.full(len(take), settings["usual"]) if value is None else value
        value = np.where(np.isfinite(value), value, settings["usual"])
        beyond = BEYOND_SHARE * (settings["high"] - settings["low"])
        return np.clip(value, settings["low"] - beyond, settings["high"] + beyond)

    def evenly(self, value: np.ndarray, settings: Settings) -> np.ndarray:
        """The column (N,) on a scale on which the effect is about as lively everywhere."""
        return value

    def form_inputs(self, take: Signals, columns: np.ndarray, settings: Settings) -> Mapping[str, np.ndarray]:
        if IN_STEPS in settings:
            return {}  # what a smooth curve would find between steps is chance
        value = self.clipped(take, settings)
        return {self.column: np.repeat(value[:, None], take.own.shape[1], axis=1)}

    def functions(self, value: np.ndarray, settings: Settings, shape: np.ndarray) -> np.ndarray:
        """(N, L, F) of the clipped context column (N,): its distance from the usual value, and the square."""
        span = max(settings["high"] - settings["low"], 1e-9)
        distance = (value - settings["usual"]) / span
        return np.repeat(np.column_stack([distance, distance**2])[:, None, :], len(shape), axis=1)

    def prior_sd(self, settings: Settings) -> np.ndarray:
        each = np.array([PRIOR_DEG, SQUARE_PRIOR_DEG])
        return np.concatenate([each, each])

    def weight_names(self, settings: Settings) -> tuple[str, ...]:
        span = max(settings["high"] - settings["low"], 1e-9)
        per = f"{span:.3g}[c.{self.column}]"
        square = f"square_of_{per}"
        return (
            f"offset_deg_per_{per}",
            f"offset_deg_per_{square}",
            f"gain_deg_per_{per}_and_sd",
            f"gain_deg_per_{square}_and_sd",
        )
