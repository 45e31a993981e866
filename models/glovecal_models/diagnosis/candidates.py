"""Every candidate effect, assessed on the same rows as its control, and in a form that the takes ask for.

The control of a learned form has the same basis, the same choice inside each fold, and the same freedom.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.calibration.added_effect import form_values
from glovecal_models.calibration.folds import folds_over_takes
from glovecal_models.calibration.form_choice import FormRows, chosen_form
from glovecal_models.calibration.held_out import (
    BaseProducts,
    FittedColumns,
    FittedRows,
    HeldOut,
    Rows,
    held_out,
)
from glovecal_models.diagnosis.column_forms import smooth_assessment, stepped_assessment
from glovecal_models.diagnosis.forward_design import ForwardDesign
from glovecal_models.diagnosis.next_take import NotIdentifiable, undecidable, wanted_takes
from glovecal_models.diagnosis.permutation_test import session_p_value
from glovecal_models.effects.base.assessment import (
    Assessment,
    HeldOutRmse,
    JointErrors,
    block_starts,
    squared_in_blocks,
)
from glovecal_models.effects.base.context_effect import ContextEffect
from glovecal_models.effects.base.control import control_columns, control_signals
from glovecal_models.effects.base.dynamics import ArrayStateEffect
from glovecal_models.effects.base.effect import CorrectionEffect, Effect, why_not_shown
from glovecal_models.effects.base.learned_form import FormTerm, LearnedForm
from glovecal_models.effects.base.signals import Settings, Signals
from glovecal_models.errors import BadInput
from glovecal_models.progress import Report

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
        effect: CorrectionEffect,
        takes: Sequence[Signals],
        settings: Settings,
        shape: np.ndarray,
        step: int = 1,
        plain: Sequence[np.ndarray] | None = None,
    ) -> FormInputs:
        """``takes`` of the joint alone, ``shape`` (1, P); ``step`` -1: their rows are in reverse; ``plain``:
        the own columns (N, 1, C) of each take, where they are known."""
        plain = plain or effect.dynamics.columns_of_takes(takes, settings, shape)
        values = [form_values(effect, take, part, settings) for take, part in zip(takes, plain, strict=True)]
        units = list(design.units(joint))
        return cls(
            [plain[take][::step][index, 0] for take, index in units],
            [{name: each[::step][index] for name, each in values[take].items()} for take, index in units],
            effect.weights(settings).prior_sd,
            values[0].take_sd_deg,
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


def formed_rmse(
    design: ForwardDesign, effect: CorrectionEffect, joint: int, seed: int = 0
) -> HeldOutRmse | None:
    """Degrees; None where these takes cannot show the effect, or allow no control. Beside one that saves
    nothing no control is worked out: it is infinite."""
    takes = design.of_joint(joint)
    if effect.not_applicable_reason(takes) is not None:
        return None
    settings, shape = _settings(effect, takes)
    right = FormInputs.of(design, joint, effect, takes, settings, shape)
    before, after = _base(design, joint), _squared(design, joint, right)
    control = _control(design, effect, joint, seed) if after < before else np.inf
    if control is None:
        return None
    rows = _count(design, joint)
    return HeldOutRmse(*(float(np.sqrt(square / rows)) for square in (before, after, control)))


def formed_control_share(
    design: ForwardDesign, effect: CorrectionEffect, rotations: Sequence[str], seed: int = 0
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


def _control(design: ForwardDesign, effect: CorrectionEffect, joint: int, seed: int) -> float | None:
    """What the control leaves, degrees squared; None where these takes allow none.

    A control that takes inputs from other takes may get nearly the right ones, as wearings are often alike:
    of several the one in the middle.
    """
    takes = design.of_joint(joint)
    if effect.not_applicable_reason(takes) is not None:
        return None
    settings, shape = _settings(effect, takes)
    step = -1 if effect.comparison.control == "time-reversed" else 1
    left = []
    for number in range(CONTROLS_TRIED if effect.comparison.control in FROM_OTHER_TAKES else 1):
        try:
            wrong = control_signals(effect, takes, np.random.default_rng(seed + number))
        except BadInput:
            return None
        left.append(
            _squared(design, joint, FormInputs.of(design, joint, effect, wrong, settings, shape, step))
        )
    return sorted(left)[len(left) // 2]


def _settings(effect: CorrectionEffect, takes: Sequence[Signals]) -> tuple[Settings, np.ndarray]:
    """Of the effect as a repair learns it, with the middle shape (1, P) of its grid."""
    settings = effect.further.constants(effect, takes)
    grid = effect.shape.grid(takes, settings)
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


PERMUTATIONS_TRIED = 5


def assessed(
    design: ForwardDesign,
    effects: Sequence[Effect],
    generator: np.random.Generator,
    without: Set[str] = frozenset(),
    report: Report | None = None,
) -> tuple[list[Assessment], list[NotIdentifiable]]:
    """Every identifiable effect, and why the others are not.

    ``without`` names effects that the model has already.
    """
    effects = [item for item in effects if item.comparison is not None and item.name not in without]
    found: list[Assessment] = []
    impossible: list[NotIdentifiable] = []
    for number, effect in enumerate(effects):
        if report:
            report(f"trying {effect.name}", number / len(effects))
        why = why_not_shown(effect, design.signals)
        if why is not None:
            wanted = wanted_takes(design.signals, effect, design.limits)
            impossible.append(NotIdentifiable(effect.name, _with_advice(effect, why), wanted=wanted))
            continue
        item = None if effect.comparison is None else effect.comparison.assess(design)
        if item is None and isinstance(effect, CorrectionEffect):
            item = _assessed(design, effect, generator)
        if isinstance(item, Assessment):
            found.append(item)
        elif item is not None:
            impossible.append(item)
    return found, impossible


def _with_advice(effect: Effect, why: str) -> str:
    if effect.context and "never changes" in why:
        return f"{why}; record takes in which it differs"
    return why


def _assessed(
    design: ForwardDesign, effect: CorrectionEffect, generator: np.random.Generator
) -> Assessment | NotIdentifiable:
    evidence = _screened(design, effect, generator)
    errors = tuple(_joint_errors(item, np.array(design.unit_take)) for item in evidence)
    found = Assessment(
        effect.name,
        design.rotations,
        errors,
        tuple(item.shape for item in evidence),
        tuple(item.true.weights for item in evidence),
        None,
        tuple(f"{item.name}_{item.unit}" for item in effect.shape.parameters),
        effect.comparison.certainty,
        design.limits,
    )
    if not effect.comparison.changes_between_takes:
        return found
    few = undecidable(design.signals, effect, design.limits)
    if few is not None:
        return NotIdentifiable(effect.name, few.why, few.record, found, (few.wanted,))
    some = any(item.contrast >= design.limits.least_session_share for item in errors)
    return replace(found, p_value=session_p_value(design, effect, generator) if some else 1.0)


def is_memory_of_known(design: ForwardDesign, effect: Effect, joint: int) -> bool:
    """Whether a memory follows what the known effects add at a joint, neither the joint's own motion nor both
    together, which is what the sensor feels: with that as its input it leaves the least held-out error.

    What a known effect adds may lag or stick by itself, as where cloth pulls behind a slack; the joint moves
    along, so that a memory of its own motion seems to be there.
    """
    if not isinstance(effect, ArrayStateEffect) or not design.known_deg or not design.known_deg[joint]:
        return False
    takes = design.of_joint(joint)
    pairs = list(zip(takes, design.known_deg[joint], strict=True))
    added = [replace(take, own=values[:, None]) for take, values in pairs]
    both = [replace(take, own=take.own + values[:, None]) for take, values in pairs]
    by_known, *others = (_left_by(design, effect, joint, each) for each in (added, takes, both))
    return by_known <= min(others)


def _left_by(design: ForwardDesign, effect: CorrectionEffect, joint: int, takes: Sequence[Signals]) -> float:
    """Held-out error with the effect's own columns, degrees squared; ``takes`` have one lane."""
    settings = effect.fit_constants(takes)
    shapes = effect.shape.grid(takes, settings)[:, 0]
    tiled = [replace(take, own=np.repeat(take.own, len(shapes), axis=1)) for take in takes]
    columns = design.rows(joint, effect.dynamics.columns_of_takes(tiled, settings, shapes))
    return float(held_out(design.products[joint], columns, effect.weights(settings).prior_sd).added.sum())


def in_any_form(
    design: ForwardDesign, effect: Effect, usual: Assessment, generator: np.random.Generator
) -> Assessment:
    """Where its usual form is not significant, a smooth one may be, or one in steps."""
    if usual.significant_joints or not isinstance(effect, ContextEffect) or usual.p_value is None:
        return usual
    forms = [(effect.has_any_form, smooth_assessment), (effect.may_act_in_steps, stepped_assessment)]
    for is_possible, assess in forms:
        # Draws of their own: whether one form is tried changes no other effect's permutations.
        found = assess(design, effect, usual, generator.spawn(1)[0]) if is_possible else None
        if found is not None and found.significant_joints:
            return found
    return usual


def _screened(
    design: ForwardDesign, effect: CorrectionEffect, generator: np.random.Generator
) -> tuple[Evidence, ...]:
    """One for each joint of the design, with one control; of permuted wearings the median of several: one may
    nearly be the true partition."""
    controls = PERMUTATIONS_TRIED if effect.comparison.control == "permuted wearings" else 1
    if effect.comparison.is_joint_by_joint:
        return tuple(
            evidence
            for joint in range(len(design.rotations))
            for evidence in _screen(design, effect, design.of_joint(joint), (joint,), generator, controls)
        )
    return _screen(design, effect, design.signals, range(len(design.rotations)), generator, controls)


def _joint_errors(evidence: Evidence, take: np.ndarray) -> JointErrors:
    true, control = evidence.true, evidence.control
    starts = block_starts([len(part) for part in true.residual])
    return JointErrors(
        squared_in_blocks(true.residual, starts),
        squared_in_blocks(true.residual_added, starts),
        squared_in_blocks(control.residual_added, starts),
        int(true.count.sum()),
        take[np.searchsorted(np.cumsum([len(part) for part in true.residual]), starts, side="right")],
    )


@dataclass(frozen=True)
class Evidence:
    """Held-out errors of one effect on one joint of one design."""

    true: HeldOut
    control: HeldOut
    shape: np.ndarray
    """(P,) of the best."""
    settings: Settings

    @property
    def contrast(self) -> float:
        """Share of the squared error saved beyond what the control saves."""
        return self.true.saved - max(self.control.saved, 0.0)


def _screen(
    design: ForwardDesign,
    effect: CorrectionEffect,
    signals: Sequence[Signals],
    joints: Sequence[int],
    generator: np.random.Generator,
    controls: int,
) -> tuple[Evidence, ...]:
    """One for each of ``joints``, the lanes of ``signals``; of so many controls the one in the middle."""
    settings = design.constants(effect) if signals is design.signals else effect.fit_constants(signals)
    grid = effect.shape.grid(signals, settings)
    shapes, lanes, numbers = grid.shape
    tiled = tuple(replace(take, own=np.tile(take.own, (1, shapes))) for take in signals)
    flat = grid.reshape(shapes * lanes, numbers)
    prior = effect.weights(settings).prior_sd
    fitted = design.once(f"fitted rows of {list(joints)}", lambda: _fitted_rows(design, joints))

    def held_out_of(columns: FittedColumns) -> list[HeldOut]:
        """Of each joint."""
        return [
            held_out(design.products[joint], columns.units(lane), prior) for lane, joint in enumerate(joints)
        ]

    true, *tried = (
        held_out_of(columns)
        for columns in _columns(effect, tiled, settings, flat, fitted, generator, controls)
    )
    middle = [sorted(items, key=lambda item: item.saved)[controls // 2] for items in zip(*tried, strict=True)]
    return tuple(
        Evidence(right, wrong, grid[right.shape, lane], settings)
        for lane, (right, wrong) in enumerate(zip(true, middle, strict=True))
    )


def _columns(
    effect: CorrectionEffect,
    takes: Sequence[Signals],
    settings: Settings,
    shape: np.ndarray,
    fitted: FittedRows,
    generator: np.random.Generator,
    controls: int,
) -> Iterator[FittedColumns]:
    """Those of the effect, then those of so many controls, only on the rows that are fitted, which are every
    second one; what remembers is run through all of them."""
    is_reversed, lanes = effect.comparison.control == "time-reversed", len(fitted.places)
    if isinstance(effect, ArrayStateEffect) and is_reversed:
        yield FittedColumns(tuple(effect.columns_by_lane(takes, settings, shape, fitted.rows, lanes)), fitted)
        for _ in range(controls):
            wrong = control_signals(effect, takes, generator)
            columns = effect.columns_by_lane(wrong, settings, shape, fitted.rows, lanes, are_backwards=True)
            yield FittedColumns(tuple(columns), fitted)
        return
    is_instant = not effect.dynamics.needs_time and not is_reversed
    rows = fitted.rows if is_instant else None
    right = takes if rows is None else [take.at(some) for take, some in zip(takes, rows, strict=True)]
    columns = effect.dynamics.columns_of_takes(right, settings, shape)
    yield FittedColumns.of(columns, fitted, are_fitted=is_instant)
    for _ in range(controls):
        columns = control_columns(effect, takes, settings, shape, generator, rows)
        yield FittedColumns.of(columns, fitted, are_fitted=is_instant)


def _fitted_rows(design: ForwardDesign, joints: Sequence[int]) -> FittedRows:
    return FittedRows.of(
        [len(take) for take in design.signals], [list(design.units(joint)) for joint in joints]
    )
