"""A cause that changes between takes and acts in equal steps of its column (``column_steps``).

Width and edge are those that explain most of all joints together. The takes' errors are permuted for the p
value, with width and edge chosen anew for each permutation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from glovecal_models.diagnosis.forward_design import ForwardDesign
from glovecal_models.diagnosis.permutation_test import share_as_large
from glovecal_models.diagnosis.pieces_of_takes import pieces_of
from glovecal_models.diagnosis.smooth_column import JOINT_P_VALUE, STRICTER, errors_beside
from glovecal_models.effects.base.assessment import Assessment
from glovecal_models.effects.base.column_steps import ColumnSteps, StepSearch
from glovecal_models.effects.base.context_effect import ContextEffect

DRAWS = ((39, 0.05), (199, 0.01), (1999, 1.0))
"""Permutations, and the share as large as recorded beyond which more of them are not worth their time."""


def stepped_assessment(
    design: ForwardDesign, effect: ContextEffect, usual: Assessment, generator: np.random.Generator
) -> Assessment | None:
    """``usual``, the effect in its usual form, with the errors that equal steps leave on the joints that go
    along with them; None where takes are too few or too many, or some have no error of a joint or no column,
    or where there is no hope."""
    takes = len(design.signals)
    count = StepSearch.pieces(takes)
    if count < 1:
        return None
    settings = design.constants(effect)
    columns = [effect.clipped(take, settings) for take in design.signals]
    known = pieces_of(design, columns, count)
    if known is None:
        return None
    search, errors = StepSearch(known[0].column), np.array([item.error for item in known])
    if not search.tried:
        return None
    orders, at, explained, share = np.arange(takes)[None, :], np.empty(0), np.empty(0), 1.0
    for draws, hopeless in DRAWS:
        orders = np.concatenate(
            [orders, [generator.permutation(takes) for _ in range(draws + 1 - len(orders))]]
        )
        at, explained = search.best(errors, orders)
        share = share_as_large(-np.log1p(-explained))
        if share > hopeless:
            return None
    middle = int(np.argsort(explained[1:].sum(axis=1))[len(orders) // 2]) + 1
    scaled = [(column - known[0].low) / known[0].span for column in columns]
    within = _within_without(search, errors, scaled)
    # The control's takes keep their errors and are given the column of other takes.
    givers = np.argsort(orders[middle]).tolist()
    given = [np.resize(scaled[giver], len(column)) for giver, column in zip(givers, scaled, strict=True)]
    control = _within_without(StepSearch(search.column[givers]), errors, given)
    found = []
    for joint, before in enumerate(usual.errors):
        if np.mean(explained[:, joint] >= explained[0, joint]) > JOINT_P_VALUE:
            found.append(replace(before, added=before.base, control=before.base))
        else:
            said = (_left_out(design, joint, values) for values in (within, control))
            found.append(errors_beside(design, joint, before, *said))
    right, low, span = search.refined(errors, int(at[0])), known[0].low, known[0].span
    steps = ColumnSteps(span * right.width, low + span * right.edge)
    return replace(usual, errors=tuple(found), p_value=min(1.0, STRICTER * share), steps=steps)


def _within_without(
    search: StepSearch, errors: np.ndarray, columns: Sequence[np.ndarray]
) -> list[list[np.ndarray]]:
    """For each take, by the steps that all other takes find best in their ``errors`` (J, T, P): where every
    take's column (N,) lies within its step."""
    takes, found = len(columns), []
    for take in range(takes):
        kept = np.arange(takes) != take
        others = StepSearch(search.column[kept])
        if not others.tried:
            found.append([np.zeros(len(column)) for column in columns])
            continue
        at, _ = others.best(errors[:, kept], np.arange(takes - 1)[None, :])
        steps = others.refined(errors[:, kept], int(at[0]))
        found.append([steps.within(column) for column in columns])
    return found


def _left_out(design: ForwardDesign, joint: int, within: Sequence[Sequence[np.ndarray]]) -> list[np.ndarray]:
    """For each unit (N,), degrees: what the other takes tell by ``within``, for each take left out the places
    within a step (N,) of every take."""
    owner, residual = np.array(design.unit_take), design.products[joint].residual
    rows = [part for _, part in design.units(joint)]
    found = []
    for unit, out in enumerate(owner):
        columns = [
            np.column_stack([np.ones(len(part)), within[out][take][part]])
            for take, part in zip(owner, rows, strict=True)
        ]
        kept = np.flatnonzero(owner != out)
        every, left = (np.concatenate([item[i] for i in kept]) for item in (columns, residual))
        found.append(columns[unit] @ np.linalg.lstsq(every.T @ every, every.T @ left, rcond=None)[0])
    return found
