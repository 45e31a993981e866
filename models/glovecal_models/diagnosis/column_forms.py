"""A cause that changes between takes in another form than its usual one: smooth, or in equal steps.

Smooth: what a Gaussian process over its column explains. A usual form may miss a cause altogether, such as
one that rings or turns back. The error of each joint, in means of ten seconds or so, is predicted in every
take from the others by the column alone. The takes' errors are permuted for the p value: with the column left
in place all permutations share one covariance matrix.

In steps of its column (``column_steps``): width and edge are those that explain most of all joints together,
chosen anew for each permutation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from glovecal_models.diagnosis.forward_design import ForwardDesign
from glovecal_models.diagnosis.permutation_test import share_as_large
from glovecal_models.effects.base.assessment import (
    Assessment,
    JointErrors,
    block_starts,
    squared_in_blocks,
)
from glovecal_models.effects.base.column_steps import ColumnSteps, StepSearch
from glovecal_models.effects.base.context_effect import ContextEffect


@dataclass(frozen=True)
class Pieces:
    """Mean errors of one joint."""

    error: np.ndarray
    """(T, P), degrees; of rows that count by their weights as ``Rows.rooted``."""
    column: np.ndarray
    """(T, P), evenly spread and scaled to 0..1."""
    piece: tuple[np.ndarray, ...]
    """For each unit (N,): the piece of each of its rows, counted through all takes."""
    low: float = 0.0
    span: float = 1.0
    """Of the column as it was recorded."""


@dataclass(frozen=True)
class _Cut:
    """One joint's rows in pieces, whatever the column."""

    error: np.ndarray
    """(T, P), degrees."""
    piece: tuple[np.ndarray, ...]
    """For each unit (N,)."""
    rows: tuple[tuple[bytes, tuple[np.ndarray, ...]], ...]
    """For each take a key of its rows, and those of each piece."""

    @classmethod
    def of(cls, design: ForwardDesign, joint: int, pieces: int) -> _Cut | None:
        """None where a take has no error of the joint."""
        takes = len(design.signals)
        rows_of: list[list[np.ndarray]] = [[] for _ in range(takes)]
        for take, rows in design.units(joint):
            rows_of[take].append(rows)
        found, piece = [], []
        for parts in rows_of:
            rows = np.sort(np.concatenate(parts)) if parts else np.empty(0, dtype=int)
            if len(rows) < pieces:
                return None
            found.append((rows.tobytes(), tuple(np.array_split(rows, pieces))))
        error, count = np.zeros((takes, pieces)), np.zeros((takes, pieces))
        edges = [np.array([part[0] for part in cut[1:]]) for _, cut in found]
        for (take, rows), residual in zip(design.units(joint), design.products[joint].residual, strict=True):
            at = np.searchsorted(edges[take], rows, side="right")
            error[take] += np.bincount(at, residual, pieces)
            count[take] += np.bincount(at, minlength=pieces)
            piece.append(take * pieces + at)
        return cls(error / np.maximum(count, 1.0), tuple(piece), tuple(found))


def pieces_of(design: ForwardDesign, columns: Sequence[np.ndarray], pieces: int) -> list[Pieces] | None:
    """So many of each take, for each joint; ``columns`` (N,) of each take. None where a take has no error of
    a joint, or the column never changes."""
    joints = range(len(design.rotations))
    cuts = design.once(f"{pieces} pieces", lambda: [_Cut.of(design, joint, pieces) for joint in joints])
    means: dict[tuple[int, bytes], list[float]] = {}
    found = []
    for cut in cuts:
        if cut is None:
            return None
        for take, (key, parts) in enumerate(cut.rows):
            if (take, key) not in means:
                means[take, key] = [float(np.mean(columns[take][part])) for part in parts]
        column = np.array([means[take, key] for take, (key, _) in enumerate(cut.rows)])
        span = float(np.ptp(column))
        if span <= 0 or not np.isfinite(span):
            return None
        low = float(column.min())
        found.append(Pieces(cut.error, (column - low) / span, cut.piece, low, span))
    return found


STEP_DRAWS = ((39, 0.05), (199, 0.01), (1999, 1.0))
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
    for draws, hopeless in STEP_DRAWS:
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


PIECES_OF_A_TAKE = 4
"""At most."""
MOST_PIECES_OF_ALL = 480
"""Of all takes: many takes are cut into fewer pieces, more than these are not judged."""
FEWEST_TAKES_OF_A_CURVE = 8
"""With fewer a smooth curve goes through the takes by chance."""
LENGTHS = (0.08, 0.15, 0.3, 0.6)
"""Lengthscales, of the column's range."""
NOISE_SHARES = (0.1, 0.4)
"""Of the variance: of each piece, and the same again of each take."""
LEVEL_SHARE = 2.0
"""Of the variance: the prior of a constant."""
FEW_DRAWS, DRAWS = 199, 1999
HOPELESS_P_VALUE = 0.1
"""A p value of few draws with which more are not worth their time."""
JOINT_P_VALUE = 0.05
"""Of a joint by itself; all joints together are judged more strictly."""
STRICTER = 5.0
"""Times the p value: the usual form was tried before, and wearings and slips go along with one smooth curve
or other. Of 96 simulated gloves that slip or sit otherwise after donning nine had 0.004 to 0.012 without it,
six with a cause that the usual forms miss 0.002, the least of so many draws (2026-11-24)."""


def smooth_assessment(
    design: ForwardDesign, effect: ContextEffect, usual: Assessment, generator: np.random.Generator
) -> Assessment | None:
    """``usual``, the effect in its usual form, with the errors that any smooth form leaves on the joints that
    go along with it; None where takes are too few or too many, or some have no error of a joint or no
    column."""
    takes = len(design.signals)
    count = min(PIECES_OF_A_TAKE, MOST_PIECES_OF_ALL // max(takes, 1))
    if takes < FEWEST_TAKES_OF_A_CURVE or count < 1:
        return None
    settings = design.constants(effect)
    columns = [effect.evenly(effect.clipped(take, settings), settings) for take in design.signals]
    known = pieces_of(design, columns, count)
    if known is None:
        return None
    # Joints that were measured at the same times, mostly all, have the same column.
    different = {item.column.tobytes(): item.column for item in known}
    without = {key: leaving_out(column) for key, column in different.items()}
    orders, left, p_value = np.arange(takes)[None, :], [], 1.0
    for draws in (FEW_DRAWS, DRAWS):
        more = [generator.permutation(takes) for _ in range(draws + 1 - len(orders))]
        orders = np.concatenate([orders, more])
        left = [_Left.of(item, orders, without[item.column.tobytes()]) for item in known]
        p_value = min(1.0, STRICTER * share_as_large(np.column_stack([item.explained for item in left])))
        if draws < DRAWS and p_value > HOPELESS_P_VALUE:
            return None
    errors = []
    for joint, before in enumerate(usual.errors):
        found = left[joint]
        if np.mean(found.explained >= found.explained[0]) > JOINT_P_VALUE:
            errors.append(replace(before, added=before.base, control=before.base))
        else:
            said = (
                [each.ravel()[at] for at in known[joint].piece] for each in (found.predicted, found.control)
            )
            errors.append(errors_beside(design, joint, before, *said))
    return replace(usual, errors=tuple(errors), p_value=p_value)


@dataclass(frozen=True)
class _Left:
    """What is explained of one joint, at the best lengthscale and noise of each draw."""

    explained: np.ndarray
    """(D,) share of the square of the takes' errors."""
    predicted: np.ndarray
    """(T, P), degrees, as the takes were recorded."""
    control: np.ndarray
    """The same in a draw that explains neither much nor little."""

    @classmethod
    def of(cls, pieces: Pieces, orders: np.ndarray, without: np.ndarray) -> _Left:
        left = left_out(pieces.error, orders, without)
        square = np.mean(left**2, axis=(2, 3))
        best, every = square.argmin(axis=0), np.arange(len(orders))
        explained = 1.0 - square[best, every] / max(float(np.mean(pieces.error**2)), 1e-12)
        middle = int(np.argsort(explained[1:])[len(explained[1:]) // 2]) + 1
        predicted, control = (pieces.error[orders[draw]] - left[best[draw], draw] for draw in (0, middle))
        return cls(explained, predicted, control)


def left_out(error: np.ndarray, orders: np.ndarray, without: np.ndarray) -> np.ndarray:
    """(K, D, T, P), degrees: errors (T, P) with takes in each of ``orders`` (D, T), less what the other takes
    and the column predict of them. ``without``: as ``leaving_out`` has it."""
    target = error[orders].reshape(len(orders), -1).T
    return (without @ target).swapaxes(1, 2).reshape(len(without), len(orders), *error.shape)


def leaving_out(column: np.ndarray) -> np.ndarray:
    """(K, T P, T P): for K choices of lengthscale and noise, what makes of errors beside ``column`` (T, P)
    those less what the other takes and the column predict of them."""
    takes, each = column.shape
    x, take = column.ravel(), np.repeat(np.arange(takes), each)
    same = take[:, None] == take[None, :]
    found = []
    for length, share in product(LENGTHS, NOISE_SHARES):
        cover = np.exp(-0.5 * ((x[:, None] - x[None, :]) / length) ** 2) + LEVEL_SHARE
        precision = np.linalg.inv(cover + share * (same + np.eye(len(x))))
        of_take = precision.reshape(takes, each, -1)
        blocks = of_take.reshape(takes, each, takes, each)[np.arange(takes), :, np.arange(takes), :]
        found.append(np.linalg.solve(blocks, of_take).reshape(precision.shape))
    return np.array(found)


def errors_beside(
    design: ForwardDesign,
    joint: int,
    before: JointErrors,
    predicted: Sequence[np.ndarray],
    control: Sequence[np.ndarray],
) -> JointErrors:
    """``before`` with what is left of the joint beside predictions (N,) of each unit's rows, degrees, and
    beside those of a control."""
    residual = design.products[joint].residual
    starts = block_starts([len(part) for part in residual])
    added, mirrored = (
        squared_in_blocks([part - said for part, said in zip(residual, each, strict=True)], starts)
        for each in (predicted, control)
    )
    return replace(before, added=added, control=mirrored)
