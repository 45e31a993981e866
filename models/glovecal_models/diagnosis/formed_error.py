"""An effect in the form that the takes ask for, and its control: held-out errors of one joint's sensor.

The control has the same basis, the same choice of a form inside each fold, and the same freedom.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.calibration.added_effect import form_values
from glovecal_models.calibration.folds import folds_over_takes
from glovecal_models.calibration.form_choice import FormRows, chosen_form
from glovecal_models.calibration.held_out import BaseProducts, Rows
from glovecal_models.diagnosis.forward_design import ForwardDesign
from glovecal_models.effects.base.assessment import HeldOutRmse
from glovecal_models.effects.base.control import control_signals
from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.base.facts import Settings
from glovecal_models.effects.base.learned_form import FormTerm, LearnedForm
from glovecal_models.effects.base.signals import Signals
from glovecal_models.errors import BadInput

FOLDS = 4
FROM_OTHER_TAKES = ("context of other takes", "permuted wearings")
CONTROLS_TRIED = 5


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
        plain: Sequence[np.ndarray] | None = None,
    ) -> FormInputs:
        """``takes`` of the joint alone, ``shape`` (1, P); ``step`` -1: their rows are in reverse; ``plain``:
        the own columns (N, 1, C) of each take, where they are known."""
        plain = plain or effect.columns_of_takes(takes, settings, shape)
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


def formed_rmse(design: ForwardDesign, effect: Effect, joint: int, seed: int = 0) -> HeldOutRmse | None:
    """Degrees; None where these takes cannot show the effect, or allow no control."""
    control = _control(design, effect, joint, seed)
    if control is None:
        return None
    takes = design.of_joint(joint)
    settings, shape = _settings(effect, takes)
    right = FormInputs.of(design, joint, effect, takes, settings, shape)
    squares = (_base(design, joint), _squared(design, joint, right), control)
    return HeldOutRmse(*(float(np.sqrt(square / _count(design, joint))) for square in squares))


def formed_control_share(
    design: ForwardDesign, effect: Effect, rotations: Sequence[str], seed: int = 0
) -> float | None:
    """Of the RMSE over ``rotations`` that the control leaves, at most 1; None as above."""
    before = after = 0.0
    for name in rotations:
        joint = design.rotations.index(name)
        control = _control(design, effect, joint, seed)
        if control is None:
            return None
        before += _base(design, joint)
        after += control
    return min(float(np.sqrt(after / before)), 1.0) if before > 0 else None


def _control(design: ForwardDesign, effect: Effect, joint: int, seed: int) -> float | None:
    """What the control leaves, degrees squared; None where these takes allow none.

    A control that takes inputs from other takes may get nearly the right ones, as wearings are often alike:
    of several the one in the middle.
    """
    takes = design.of_joint(joint)
    if effect.not_applicable_reason(takes) is not None:
        return None
    settings, shape = _settings(effect, takes)
    step = -1 if effect.control == "time-reversed" else 1
    left = []
    for number in range(CONTROLS_TRIED if effect.control in FROM_OTHER_TAKES else 1):
        try:
            wrong = control_signals(effect, takes, np.random.default_rng(seed + number))
        except BadInput:
            return None
        left.append(
            _squared(design, joint, FormInputs.of(design, joint, effect, wrong, settings, shape, step))
        )
    return sorted(left)[len(left) // 2]


def _settings(effect: Effect, takes: Sequence[Signals]) -> tuple[Settings, np.ndarray]:
    """Of the effect as a repair learns it, with the middle shape (1, P) of its grid."""
    settings = effect.fit_repair_constants(takes)
    grid = effect.grid(takes, settings)
    return settings, grid[len(grid) // 2]


def _count(design: ForwardDesign, joint: int) -> int:
    return max(sum(len(unit.target) for unit in design.products[joint].units), 1)


def _base(design: ForwardDesign, joint: int) -> float:
    """Without the effect, degrees squared."""
    return design.once(f"held-out base {joint}", lambda: _squared(design, joint, None))


def _squared(design: ForwardDesign, joint: int, inputs: FormInputs | None) -> float:
    """Sum of squares, degrees squared, on units held out in folds; the form is chosen on the others."""
    units = design.products[joint].units
    owner = np.array(design.unit_take)
    if len(np.unique(owner)) < 2:
        owner = np.arange(len(units))  # pieces of the only take
    total = 0.0
    for fold in folds_over_takes(owner, FOLDS):
        held, kept = (np.flatnonzero(mask).tolist() for mask in (fold.held_out, ~fold.held_out))
        if kept:
            total += _squared_on(design, joint, inputs, kept, held)
    return total


def _squared_on(
    design: ForwardDesign, joint: int, inputs: FormInputs | None, kept: Sequence[int], held: Sequence[int]
) -> float:
    products = design.products[joint]
    rows, sd = products.units, products.prior_sd
    if inputs is not None:
        extra, prior = inputs.plain, inputs.prior_sd
        terms = inputs.terms(design, joint, kept)
        if terms:
            form = LearnedForm.over(terms, [inputs.values[unit] for unit in kept])
            learned = [form.columns(values)[:, 0, :] for values in inputs.values]
            extra = [np.column_stack(pair) for pair in zip(extra, learned, strict=True)]
            prior = np.concatenate([prior, np.ones(form.count)])
        sd = np.concatenate([sd, prior])
        pairs = zip(rows, extra, strict=True)
        rows = [Rows(np.column_stack([unit.base, part]), unit.target) for unit, part in pairs]
    fitted = BaseProducts([rows[unit] for unit in kept], sd, products.own)
    left = [rows[unit].target - fitted.fitted(rows[unit].base) for unit in held]
    return float(sum(part @ part for part in left))
