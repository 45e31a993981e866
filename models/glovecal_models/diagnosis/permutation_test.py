"""Permutation test of a cause that changes from take to take: the takes are the exchangeable units.

Blocks of one take share its context, so they are not independent: only the takes are. The context of each
take (or its wearing) is given to another one, and the same columns are fitted; base and rows stay.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from glovecal_models.comparison.wearings import partition_of, permuted_sessions
from glovecal_models.diagnosis.forward_design import ForwardDesign
from glovecal_models.effects.base.control import motions_of, with_context
from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.base.history_effect import LONGEST_GAP_S
from glovecal_models.effects.base.signals import Signals

PERMUTATIONS = 299
ROWS_PER_TAKE = 80


def session_p_value(design: ForwardDesign, effect: Effect, generator: np.random.Generator) -> float:
    """Share of permutations that explain as much, over all joints together or on one.

    The smaller of the two shares is compared with the smaller of each permutation's own, which corrects for
    the choice between them.
    """
    joints = range(len(design.rotations))
    permutations = _permutations(design, effect, generator)
    settings = effect.fit_constants(design.signals)
    grid = effect.grid(design.signals, settings)
    rows = [_thinned(take.time_s) for take in design.signals]
    thin = [_some(take, some) for take, some in zip(design.signals, rows, strict=True)]
    bases, targets = zip(*(_projected(design, joint, rows) for joint in joints), strict=True)
    prior = effect.prior_sd(settings)

    def explained(takes: Sequence[Signals]) -> np.ndarray:
        each = [np.concatenate([effect.columns(take, settings, shape) for take in takes]) for shape in grid]
        return np.array(
            [
                max(_explained(columns[used, joint], base, target, prior) for columns in each)
                for base, (target, used), joint in zip(bases, targets, joints, strict=True)
            ]
        )

    every = np.array(
        [explained(thin), *(explained(_permuted(thin, order, effect)) for order in permutations)]
    )
    shares = np.minimum(_shares_as_large(every.sum(axis=1)), _shares_as_large(every.max(axis=1)))
    return float(np.mean(shares <= shares[0] * (1 + 1e-9)))


def _shares_as_large(values: np.ndarray) -> np.ndarray:
    """For each of (D,): the share of all that are as large."""
    return np.mean(values[None, :] >= values[:, None] * (1 - 1e-9), axis=1)


def wearing_permutations(takes: Sequence[Signals], generator: np.random.Generator) -> list[np.ndarray]:
    """Other assignments of takes to wearings, among takes of the same motion where names tell motions."""
    names = [take.wearing for take in takes]
    order = list(dict.fromkeys(names))
    owners = np.array([order.index(name) for name in names])
    groups = _motion_groups(owners, motions_of(takes))
    if groups:
        return _within_motions(owners, groups, generator)
    return permuted_sessions(owners, PERMUTATIONS, generator)


def _permutations(design: ForwardDesign, effect: Effect, generator: np.random.Generator) -> list[np.ndarray]:
    if effect.control == "permuted wearings":
        return wearing_permutations(design.signals, generator)
    return [generator.permutation(len(design.signals)) for _ in range(PERMUTATIONS)]


def _motion_groups(owners: np.ndarray, motions: Sequence[str]) -> list[np.ndarray]:
    """Takes of one motion each that was done in several wearings; none when names tell few such motions."""
    groups = [np.flatnonzero([m == motion for m in motions]) for motion in dict.fromkeys(motions)]
    permuted = [group for group in groups if len(set(owners[group].tolist())) > 1]
    if len(groups) < 2 or 2 * sum(map(len, permuted)) < len(owners):
        return []
    return permuted


def _within_motions(
    owners: np.ndarray, groups: Sequence[np.ndarray], generator: np.random.Generator
) -> list[np.ndarray]:
    """Distinct permutations that move takes only within their group."""
    found: dict[tuple[int, ...], np.ndarray] = {}
    for _ in range(20 * PERMUTATIONS):
        permuted = owners.copy()
        for group in groups:
            permuted[group] = owners[generator.permutation(group)]
        found[partition_of(permuted)] = permuted
    found.pop(partition_of(owners), None)
    return list(found.values())[:PERMUTATIONS]


def _permuted(takes: Sequence[Signals], order: np.ndarray, effect: Effect) -> list[Signals]:
    if effect.control == "permuted wearings":
        names = list(dict.fromkeys(take.wearing for take in takes))
        return [replace(take, wearing=names[int(to)]) for take, to in zip(takes, order, strict=True)]
    return [with_context(take, takes[int(to)]) for take, to in zip(takes, order, strict=True)]


def _thinned(time_s: np.ndarray) -> np.ndarray:
    """Rows of a take: few, but close enough that nothing that remembers takes them for a gap."""
    length = len(time_s)
    wanted = max(ROWS_PER_TAKE, round(2.0 * float(time_s[-1] - time_s[0]) / LONGEST_GAP_S)) if length else 0
    return np.unique(np.linspace(0, length - 1, min(wanted, length)).astype(int))


def _some(take: Signals, rows: np.ndarray) -> Signals:
    return replace(
        take,
        time_s=take.time_s[rows],
        own=take.own[rows],
        others={name: values[rows] for name, values in take.others.items()},
        context={name: values[rows] for name, values in take.context.items()},
    )


def _projected(
    design: ForwardDesign, joint: int, rows: Sequence[np.ndarray]
) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]:
    """An orthonormal base, what it leaves of the target, and which of the thinned rows were measured."""
    starts = np.cumsum([0, *(len(some) for some in rows)])
    base, target, used = [], [], []
    for unit, (take, fitted) in zip(design.products[joint].units, design.units(joint), strict=True):
        if not len(fitted):
            continue
        some = rows[take]
        at = np.clip(np.searchsorted(fitted, some), 0, len(fitted) - 1)
        near = np.abs(fitted[at] - some) <= 2
        base.append(unit.base[at[near]])
        target.append(unit.target[at[near]])
        used.append(starts[take] + np.flatnonzero(near))
    orthogonal, _ = np.linalg.qr(np.concatenate(base))
    values = np.concatenate(target)
    return orthogonal, (values - orthogonal @ (orthogonal.T @ values), np.concatenate(used))


def _explained(columns: np.ndarray, base: np.ndarray, target: np.ndarray, prior: np.ndarray) -> float:
    """Share of the target's square that columns explain beside the base, weights shrunk by their prior."""
    left = columns - base @ (base.T @ columns)
    square = float(target @ target)
    if square <= 0:
        return 0.0
    gram = left.T @ left + np.diag(square / len(target) / prior**2 * 4.0)
    right = left.T @ target
    return float(right @ np.linalg.solve(gram, right)) / square
