"""Which effects a session cannot tell apart, before anything is named: by what each could add.

Each effect's columns are taken at the middle of its grid, scaled by the prior of their weights, and what the
static map explains is projected out. The correlation of two effects is that of what one adds, in expectation
over its prior, with its best imitation by the other. The condition number is that of the main directions of
all effects together (Belsley, Kuh & Welsch 1980: above 30 they cannot be separated).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.diagnosis.detectability.answer import Confusability, PairOfEffects
from glovecal_models.diagnosis.detectability.injection import (
    VISIBLE_SHARE,
    columns_of,
    delayed_by,
    is_delay,
)
from glovecal_models.diagnosis.forward_design import ForwardDesign
from glovecal_models.diagnosis.limits import DiagnosisLimits
from glovecal_models.diagnosis.next_take import next_take
from glovecal_models.diagnosis.problem import DiagnosisProblem
from glovecal_models.effects.base.effect import CorrectionEffect, Effect, why_not_shown
from glovecal_models.effects.catalogue import candidates, relations

SMALL_DELAY_S = 0.02
KEPT_SHARE = 0.99
"""Of the square that an effect's prior expects: directions beyond are not counted as its own."""
SINGULAR = 1e-8
ROWS_LOOKED_AT = 4000
"""Of one rotation; rows are alike in time, so every k-th does."""


def confusability(
    problem: DiagnosisProblem, effects: Sequence[Effect] | None = None, declared: Sequence[Effect] = ()
) -> Confusability:
    """``effects``: None for the whole catalogue, those ``declared`` by a user and every context column."""
    design = problem.design()
    every = candidates(design.signals, declared) if effects is None else list(effects)
    known = [item.effect.name for item in problem.known]
    has = {other for name in known for other in (name, *relations().alike_to(name))}
    found, why = [], {}
    for item in every:
        if item.name in has or not (isinstance(item, CorrectionEffect) or is_delay(item)):
            continue
        reason = why_not_shown(item, design.signals)
        if reason is None:
            found.append(item)
        else:
            why[item.name] = reason
    by_name = {item.name: item for item in found}
    pairs: dict[frozenset[str], PairOfEffects] = {}
    condition, of_others = {}, {}
    for joint, rotation in enumerate(design.rotations):
        directions = {
            item.name: own for item in found if (own := _directions(design, item, joint)) is not None
        }
        condition[rotation] = _condition(list(directions.values()))
        here = _pairs(directions, rotation, problem.limits)
        confused = {pair.effects[0] for pair in here if pair.is_confused}
        of_others[rotation] = _condition([own for name, own in directions.items() if name not in confused])
        for pair in here:
            key = frozenset(pair.effects)
            if key not in pairs or pair.correlation > pairs[key].correlation:
                pairs[key] = pair
    ordered = sorted(pairs.values(), key=lambda pair: -pair.correlation)
    return Confusability(
        tuple(by_name),
        tuple(_decided(pair, by_name) for pair in ordered),
        _finite(condition),
        _finite(of_others),
        why,
        problem.limits.confused_condition,
    )


@dataclass(frozen=True)
class _Directions:
    """What one effect adds to one joint: orthonormal directions of the rows, and the RMS along each."""

    basis: np.ndarray
    """(N, K)."""
    size: np.ndarray
    """(K,)."""

    def imitated_by(self, other: _Directions) -> float:
        """Correlation of what it adds with the other's best imitation."""
        of_basis = other.basis.T @ self.basis
        share = np.sum((of_basis * self.size) ** 2) / np.sum(self.size**2)
        return float(np.sqrt(min(share, 1.0)))


def _directions(design: ForwardDesign, effect: Effect, joint: int) -> _Directions | None:
    """None where the static map explains all that it adds."""
    if not isinstance(effect, CorrectionEffect):
        moved = delayed_by(design.signals, joint, SMALL_DELAY_S)
        parts, prior = [part[:, None] for part in moved], np.ones(1)
    else:
        found = columns_of(design.signals, design.known, effect, joint)
        parts, prior = found.parts, found.prior_sd
    columns = np.concatenate(design.rows(joint, parts)) * prior
    base = np.concatenate([unit.base for unit in design.products[joint].units])
    step = max(1, len(columns) // ROWS_LOOKED_AT)
    columns, base = columns[::step], base[::step]
    left = columns - base @ np.linalg.lstsq(base, columns, rcond=None)[0]
    if not columns.shape[1] or np.sum(left**2) <= VISIBLE_SHARE**2 * max(np.sum(columns**2), 1e-12):
        return None
    basis, size, _ = np.linalg.svd(left, full_matrices=False)
    share = np.cumsum(size**2) / np.sum(size**2)
    kept = 1 + int(np.searchsorted(share, KEPT_SHARE))
    return _Directions(basis[:, :kept], size[:kept])


def _pairs(
    directions: Mapping[str, _Directions], rotation: str, limits: DiagnosisLimits
) -> list[PairOfEffects]:
    names, found = list(directions), []
    for number, first in enumerate(names):
        for second in names[number + 1 :]:
            of_first = directions[first].imitated_by(directions[second])
            of_second = directions[second].imitated_by(directions[first])
            effects = (first, second) if of_first >= of_second else (second, first)
            most = max(of_first, of_second)
            found.append(PairOfEffects(effects, rotation, most, most >= limits.confused_correlation))
    return found


def _condition(directions: Sequence[_Directions]) -> float:
    if not directions:
        return 1.0
    every = np.column_stack([item.basis for item in directions])
    if every.shape[1] > len(every):
        return float("inf")
    sizes = np.linalg.svd(every, compute_uv=False)
    return float(sizes[0] / sizes[-1]) if sizes[-1] > SINGULAR * sizes[0] else float("inf")


def _finite(conditions: Mapping[str, float]) -> dict[str, float | None]:
    return {name: value if np.isfinite(value) else None for name, value in conditions.items()}


def _decided(pair: PairOfEffects, effects: Mapping[str, Effect]) -> PairOfEffects:
    if not pair.is_confused:
        return pair
    return PairOfEffects(
        pair.effects, pair.rotation, pair.correlation, True, next_take(pair.effects, effects)
    )
