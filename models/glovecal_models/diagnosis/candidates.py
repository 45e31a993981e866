"""Every candidate effect, assessed on the same rows as its control."""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.calibration.held_out import HeldOut, held_out
from glovecal_models.diagnosis.forward_design import ForwardDesign
from glovecal_models.diagnosis.not_identifiable import NotIdentifiable, undecidable
from glovecal_models.diagnosis.permutation_test import session_p_value
from glovecal_models.effects.base.assessment import (
    Assessment,
    JointErrors,
    block_starts,
    squared_in_blocks,
)
from glovecal_models.effects.base.control import control_columns
from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.base.facts import Settings
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
        return found
    few = undecidable(design.signals, effect, design.limits)
    if few is not None:
        return NotIdentifiable(effect.name, few.why, few.record, found)
    some = any(item.contrast >= design.limits.least_session_share for item in errors)
    return replace(found, p_value=session_p_value(design, effect, generator) if some else 1.0)


def _screened(design: ForwardDesign, effect: Effect, generator: np.random.Generator) -> tuple[Evidence, ...]:
    """With one control; of permuted wearings the median of several: one may nearly be the true partition."""
    if effect.control != "permuted wearings":
        return screen(design, effect, generator)
    tried = [screen(design, effect, generator) for _ in range(PERMUTATIONS_TRIED)]
    middle = [
        sorted(items, key=lambda item: item.control.saved)[PERMUTATIONS_TRIED // 2]
        for items in zip(*tried, strict=True)
    ]
    return tuple(middle)


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


def screen(design: ForwardDesign, effect: Effect, generator: np.random.Generator) -> tuple[Evidence, ...]:
    """One for each joint of the design."""
    if effect.one_joint_at_a_time:
        return tuple(_one_joint(design, effect, joint, generator) for joint in range(len(design.rotations)))
    return _all_joints(design, effect, design.signals, generator)


def _one_joint(design: ForwardDesign, effect: Effect, joint: int, generator: np.random.Generator) -> Evidence:
    return _all_joints(design, effect, design.of_joint(joint), generator, joints=(joint,))[0]


def _all_joints(
    design: ForwardDesign,
    effect: Effect,
    signals: Sequence[Signals],
    generator: np.random.Generator,
    joints: Sequence[int] | None = None,
) -> tuple[Evidence, ...]:
    joints = range(len(design.rotations)) if joints is None else joints
    settings = effect.fit_constants(signals)
    grid = effect.grid(signals, settings)
    shapes, lanes, numbers = grid.shape
    tiled = tuple(replace(take, own=np.tile(take.own, (1, shapes))) for take in signals)
    flat = grid.reshape(shapes * lanes, numbers)

    def by_lane(columns: np.ndarray) -> np.ndarray:
        """(L, N, G, C), in this order in memory, too: rows are taken lane by lane."""
        return columns.reshape(len(columns), shapes, lanes, -1).transpose(2, 0, 1, 3).copy()

    true = [by_lane(part) for part in effect.columns_of_takes(tiled, settings, flat)]
    control = [by_lane(part) for part in control_columns(effect, tiled, settings, flat, generator)]
    prior = effect.prior_sd(settings)
    found = []
    for lane, joint in enumerate(joints):
        products = design.products[joint]
        right = held_out(products, design.rows(joint, [part[lane] for part in true]), prior)
        wrong = held_out(products, design.rows(joint, [part[lane] for part in control]), prior)
        found.append(Evidence(right, wrong, grid[right.shape, lane], settings))
    return tuple(found)
