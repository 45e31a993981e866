"""What the learned form of an effect is chosen on in a forward design: one joint, unit by unit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.calibration.added_effect import form_values
from glovecal_models.calibration.form_choice import FormRows, chosen_form
from glovecal_models.diagnosis.forward_design import ForwardDesign
from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.base.facts import Settings
from glovecal_models.effects.base.learned_form import FormTerm
from glovecal_models.effects.base.signals import Signals


@dataclass(frozen=True)
class FormInputs:
    """An effect's own columns on one joint, and the signals that its form may be a function of."""

    plain: list[np.ndarray]
    """For each unit (N, C)."""
    values: list[Mapping[str, np.ndarray]]
    """For each unit, each (N, 1); empty for an effect without a form."""
    prior_sd: np.ndarray
    """(C,) of the own columns' weights."""
    take_sd_deg: float

    @classmethod
    def of(
        cls,
        design: ForwardDesign,
        joint: int,
        effect: Effect,
        takes: Sequence[Signals],
        settings: Settings,
        shape: np.ndarray,
        step: int = 1,
    ) -> FormInputs:
        """``takes`` of the joint alone, ``shape`` (1, P); ``step`` -1: their rows are in reverse."""
        plain = effect.columns_of_takes(takes, settings, shape)
        values = [form_values(effect, take, part, settings) for take, part in zip(takes, plain, strict=True)]
        units = list(design.units(joint))
        return cls(
            [plain[take][::step][index, 0] for take, index in units],
            [{name: each[::step][index] for name, each in values[take].items()} for take, index in units],
            effect.prior_sd(settings),
            effect.take_sd_deg,
        )

    def terms(self, design: ForwardDesign, joint: int, units: Sequence[int]) -> tuple[FormTerm, ...]:
        """Those that ``units`` of the design ask for; none where there is nothing to choose from."""
        if not self.values[0]:
            return ()
        base = design.products[joint].units
        rows = FormRows.of(
            [base[unit] for unit in units],
            [self.plain[unit] for unit in units],
            self.prior_sd,
            [design.unit_take[unit] for unit in units],
            self.take_sd_deg,
            [self.values[unit] for unit in units],
        )
        return chosen_form([rows])
