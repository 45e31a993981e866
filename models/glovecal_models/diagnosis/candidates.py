"""Every candidate effect, assessed on the same rows as its control."""

from __future__ import annotations

from collections.abc import Iterator, Sequence, Set
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.calibration.held_out import FittedColumns, FittedRows, HeldOut, held_out
from glovecal_models.diagnosis.forward_design import ForwardDesign
from glovecal_models.diagnosis.not_identifiable import NotIdentifiable, undecidable
from glovecal_models.diagnosis.permutation_test import session_p_value
from glovecal_models.diagnosis.smooth_column import smooth_assessment
from glovecal_models.diagnosis.stepped_column import stepped_assessment
from glovecal_models.effects.base.assessment import (
    Assessment,
    JointErrors,
    block_starts,
    squared_in_blocks,
)
from glovecal_models.effects.base.context_effect import ContextEffect
from glovecal_models.effects.base.control import control_columns, control_signals
from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.base.facts import Settings
from glovecal_models.effects.base.history_effect import ArrayStateEffect
from glovecal_models.effects.base.signals import Signals
from glovecal_models.progress import Report

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
    effects = [item for item in effects if item.stage == "compared" and item.name not in without]
    found: list[Assessment] = []
    impossible: list[NotIdentifiable] = []
    for number, effect in enumerate(effects):
        if report:
            report(f"trying {effect.name}", number / len(effects))
        why = effect.not_applicable_reason(design.signals)
        if why is not None:
            impossible.append(NotIdentifiable(effect.name, _with_advice(effect, why)))
            continue
        item = effect.assess(design) or _assessed(design, effect, generator)
        if isinstance(item, Assessment):
            found.append(item)
        else:
            impossible.append(item)
    return found, impossible


def _with_advice(effect: Effect, why: str) -> str:
    if effect.context and "never changes" in why:
        return f"{why}; record takes in which it differs"
    return why


def _assessed(
    design: ForwardDesign, effect: Effect, generator: np.random.Generator
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
        tuple(f"{item.name}_{item.unit}" for item in effect.parameters),
        effect.certainty,
        design.limits,
    )
    if not effect.changes_between_takes:
        of_known = (i for i in found.significant_joints if is_memory_of_known(design, effect, i))
        return replace(found, of_known=tuple(of_known))
    few = undecidable(design.signals, effect, design.limits)
    if few is not None:
        return NotIdentifiable(effect.name, few.why, few.record, found)
    some = any(item.contrast >= design.limits.least_session_share for item in errors)
    found = replace(found, p_value=session_p_value(design, effect, generator) if some else 1.0)
    return _in_any_form(design, effect, found, generator)


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


def _left_by(design: ForwardDesign, effect: Effect, joint: int, takes: Sequence[Signals]) -> float:
    """Held-out error with the effect's own columns, degrees squared; ``takes`` have one lane."""
    settings = effect.fit_constants(takes)
    shapes = effect.grid(takes, settings)[:, 0]
    tiled = [replace(take, own=np.repeat(take.own, len(shapes), axis=1)) for take in takes]
    columns = design.rows(joint, effect.columns_of_takes(tiled, settings, shapes))
    return float(held_out(design.products[joint], columns, effect.prior_sd(settings)).added.sum())


def _in_any_form(
    design: ForwardDesign, effect: Effect, usual: Assessment, generator: np.random.Generator
) -> Assessment:
    """Where its usual form is not significant, a smooth one may be, or one in steps."""
    if usual.significant_joints or not isinstance(effect, ContextEffect):
        return usual
    forms = [(effect.has_any_form, smooth_assessment), (effect.may_act_in_steps, stepped_assessment)]
    for is_possible, assess in forms:
        # Draws of their own: whether one form is tried changes no other effect's permutations.
        found = assess(design, effect, usual, generator.spawn(1)[0]) if is_possible else None
        if found is not None and found.significant_joints:
            return found
    return usual


def _screened(design: ForwardDesign, effect: Effect, generator: np.random.Generator) -> tuple[Evidence, ...]:
    """One for each joint of the design, with one control; of permuted wearings the median of several: one may
    nearly be the true partition."""
    controls = PERMUTATIONS_TRIED if effect.control == "permuted wearings" else 1
    if effect.one_joint_at_a_time:
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
    effect: Effect,
    signals: Sequence[Signals],
    joints: Sequence[int],
    generator: np.random.Generator,
    controls: int,
) -> tuple[Evidence, ...]:
    """One for each of ``joints``, the lanes of ``signals``; of so many controls the one in the middle."""
    settings = design.constants(effect) if signals is design.signals else effect.fit_constants(signals)
    grid = effect.grid(signals, settings)
    shapes, lanes, numbers = grid.shape
    tiled = tuple(replace(take, own=np.tile(take.own, (1, shapes))) for take in signals)
    flat = grid.reshape(shapes * lanes, numbers)
    prior = effect.prior_sd(settings)
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
    effect: Effect,
    takes: Sequence[Signals],
    settings: Settings,
    shape: np.ndarray,
    fitted: FittedRows,
    generator: np.random.Generator,
    controls: int,
) -> Iterator[FittedColumns]:
    """Those of the effect, then those of so many controls, only on the rows that are fitted, which are every
    second one; what remembers is run through all of them."""
    is_reversed, lanes = effect.control == "time-reversed", len(fitted.places)
    if isinstance(effect, ArrayStateEffect) and is_reversed:
        yield FittedColumns(tuple(effect.columns_by_lane(takes, settings, shape, fitted.rows, lanes)), fitted)
        for _ in range(controls):
            wrong = control_signals(effect, takes, generator)
            columns = effect.columns_by_lane(wrong, settings, shape, fitted.rows, lanes, are_backwards=True)
            yield FittedColumns(tuple(columns), fitted)
        return
    is_instant = not effect.needs_time and not is_reversed
    rows = fitted.rows if is_instant else None
    right = takes if rows is None else [take.at(some) for take, some in zip(takes, rows, strict=True)]
    columns = effect.columns_of_takes(right, settings, shape)
    yield FittedColumns.of(columns, fitted, are_fitted=is_instant)
    for _ in range(controls):
        columns = control_columns(effect, takes, settings, shape, generator, rows)
        yield FittedColumns.of(columns, fitted, are_fitted=is_instant)


def _fitted_rows(design: ForwardDesign, joints: Sequence[int]) -> FittedRows:
    return FittedRows.of(
        [len(take) for take in design.signals], [list(design.units(joint)) for joint in joints]
    )
