"""Could a cause that changes from take to take explain so much by chance? Takes are dealt in other ways.

Blocks of one take share its context, so they are no independent witnesses: only the takes are. The context of
each take (or its wearing) is given to another one, and the same columns are fitted; base and rows stay.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from glovecal_models.comparison.wearings import other_deals, partition_of
from glovecal_models.diagnosis.directions import Direction
from glovecal_models.effects.decoy import motions_of, with_context
from glovecal_models.effects.effect import Effect, Signals
from glovecal_models.effects.history_effect import LONGEST_GAP_S

DEALS = 299
ROWS_PER_TAKE = 80
FEWEST_DEALS = 19
"""With fewer no answer can be better than one in twenty."""


def session_probability(direction: Direction, effect: Effect, generator: np.random.Generator) -> float | None:
    """Share of deals that explain as much, of all joints together or of one; None when there are too few.

    The smaller of the two shares counts twice.
    """
    joints = range(len(direction.rotations))
    deals = _deals(direction, effect, generator)
    if deals is None:
        return None
    settings = effect.settle(direction.signals)
    grid = effect.grid(direction.signals, settings)
    rows = [_thinned(take.time_s) for take in direction.signals]
    thin = [_some(take, some) for take, some in zip(direction.signals, rows, strict=True)]
    bases, targets = zip(*(_projected(direction, joint, rows) for joint in joints), strict=True)
    prior = effect.prior_sd(settings)

    def explained(takes: Sequence[Signals]) -> np.ndarray:
        each = [np.concatenate([effect.columns(take, settings, shape) for take in takes]) for shape in grid]
        return np.array(
            [
                max(_explained(columns[used, joint], base, target, prior) for columns in each)
                for base, (target, used), joint in zip(bases, targets, joints, strict=True)
            ]
        )

    true = explained(thin)
    others = np.array([explained(_dealt(thin, deal, effect)) for deal in deals])
    together = np.mean([*(others.sum(axis=1) >= true.sum() * (1 - 1e-9)), True])
    single = np.mean([*(others.max(axis=1) >= true.max() * (1 - 1e-9)), True])
    return float(min(1.0, 2 * min(together, single)))


def _deals(direction: Direction, effect: Effect, generator: np.random.Generator) -> list[np.ndarray] | None:
    count = len(direction.signals)
    if effect.decoy == "dealt wearings":
        names = [take.wearing for take in direction.signals]
        order = list(dict.fromkeys(names))
        owners = np.array([order.index(name) for name in names])
        deals = _within_motions(owners, motions_of(direction.signals), generator)
        if not deals:
            deals = other_deals(owners, DEALS, generator)
        return deals if len(deals) >= FEWEST_DEALS else None
    if count < 5:
        return None
    return [generator.permutation(count) for _ in range(DEALS)]


def _within_motions(
    owners: np.ndarray, motions: Sequence[str], generator: np.random.Generator
) -> list[np.ndarray]:
    """Distinct deals that move takes only among takes of the same motion; none when names tell no motions."""
    groups = [np.flatnonzero([m == motion for m in motions]) for motion in dict.fromkeys(motions)]
    if len(groups) < 2 or any(len(set(owners[group].tolist())) < 2 for group in groups):
        return []
    found: dict[tuple[int, ...], np.ndarray] = {}
    for _ in range(20 * DEALS):
        dealt = owners.copy()
        for group in groups:
            dealt[group] = owners[generator.permutation(group)]
        found[partition_of(dealt)] = dealt
    found.pop(partition_of(owners), None)
    return list(found.values())[:DEALS]


def _dealt(takes: Sequence[Signals], deal: np.ndarray, effect: Effect) -> list[Signals]:
    if effect.decoy == "dealt wearings":
        order = list(dict.fromkeys(take.wearing for take in takes))
        return [replace(take, wearing=order[int(to)]) for take, to in zip(takes, deal, strict=True)]
    return [with_context(take, takes[int(to)]) for take, to in zip(takes, deal, strict=True)]


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
    direction: Direction, joint: int, rows: Sequence[np.ndarray]
) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]:
    """An orthonormal base, what it leaves of the target, and which of the thinned rows were measured."""
    starts = np.cumsum([0, *(len(some) for some in rows)])
    base, target, used = [], [], []
    for unit, (take, fitted) in zip(direction.products[joint].units, direction.units(joint), strict=True):
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
    """Share of the target's square that columns save beside the base, weights held by their prior."""
    left = columns - base @ (base.T @ columns)
    square = float(target @ target)
    gram = left.T @ left + np.diag(square / len(target) / prior**2 * 4.0)
    right = left.T @ target
    return float(right @ np.linalg.solve(gram, right)) / square
