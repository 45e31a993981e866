"""Every effect that could be missing, assessed on the same rows."""

from __future__ import annotations

from collections.abc import Callable, Sequence, Set
from dataclasses import dataclass

import numpy as np

from glovecal_models.diagnosis.assessment import LEAST_SESSION_CONTRAST, Assessment, JointErrors
from glovecal_models.diagnosis.delay_verdict import clock_choice
from glovecal_models.diagnosis.delays import block_starts, delay_errors
from glovecal_models.diagnosis.directions import Direction
from glovecal_models.diagnosis.screening import Evidence, screen
from glovecal_models.diagnosis.session_chance import session_probability
from glovecal_models.effects.columnless_effect import ColumnlessEffect
from glovecal_models.effects.effect import Effect

BLOCK_ROWS = 125
"""5 s of the rows that are fitted."""
SESSION_DECOYS = ("context of other takes", "dealt wearings")


@dataclass(frozen=True)
class NotJudgeable:
    """An effect these takes cannot show."""

    effect: str
    why: str


def assessed(
    direction: Direction,
    effects: Sequence[Effect],
    generator: np.random.Generator,
    without: Set[str] = frozenset(),
    report: Callable[[str, float], None] | None = None,
) -> tuple[list[Assessment], list[NotJudgeable]]:
    """Every judgeable effect, and why the others are not.

    ``lag`` brings ``clock_offset`` with it; ``without`` names effects that the model has already.
    """
    effects = [effect for effect in effects if effect.name not in without or effect.name == "lag"]
    effects = [effect for effect in effects if not isinstance(effect, ColumnlessEffect)]
    found: list[Assessment] = []
    impossible: list[NotJudgeable] = []
    for number, effect in enumerate(effects):
        if report:
            report(f"trying {effect.name}", number / len(effects))
        why = effect.missing(direction.signals)
        if why is not None:
            impossible.append(NotJudgeable(effect.name, why))
        elif effect.name == "lag":
            found.extend(item for item in _delays(direction) if item.effect not in without)
        else:
            found.append(_assessed(direction, effect, generator))
    return found, impossible


def _assessed(direction: Direction, effect: Effect, generator: np.random.Generator) -> Assessment:
    evidence = screen(direction, effect, generator)
    errors = tuple(_joint_errors(item, np.array(direction.unit_take)) for item in evidence)
    probability = None
    if effect.decoy in SESSION_DECOYS:
        some = [i for i, item in enumerate(errors) if item.contrast >= LEAST_SESSION_CONTRAST]
        probability = 1.0
        if some:
            found = session_probability(direction, effect, generator)
            probability = 1.0 if found is None else found
    return Assessment(
        effect.name,
        direction.rotations,
        errors,
        tuple(item.shape for item in evidence),
        tuple(item.true.weights for item in evidence),
        probability,
        tuple(f"{item.name}_{item.unit}" for item in effect.parameters),
    )


def _joint_errors(evidence: Evidence, take: np.ndarray) -> JointErrors:
    true, decoy = evidence.true, evidence.decoy
    starts = block_starts([len(part) for part in true.residual], BLOCK_ROWS)
    return JointErrors(
        _blocks(true.residual, starts),
        _blocks(true.residual_added, starts),
        _blocks(decoy.residual_added, starts),
        int(true.count.sum()),
        take[np.searchsorted(np.cumsum([len(part) for part in true.residual]), starts, side="right")],
    )


def _blocks(residual: Sequence[np.ndarray], starts: np.ndarray) -> np.ndarray:
    return np.add.reduceat(np.concatenate(residual) ** 2, starts)


def _delays(direction: Direction) -> list[Assessment]:
    """Clock offset, one for all joints (where that pays, one a take); lag, each joint its own."""
    grids = delay_errors(direction, BLOCK_ROWS)
    base = [_held_out_blocks(direction, joint) for joint in range(len(grids))]
    rows = [int(products.count.sum()) for products in direction.products]
    clock = clock_choice(grids)
    offsets = [
        JointErrors(b, b - grid.unmoved + moved, b - grid.unmoved + mirrored, n)
        for b, grid, moved, mirrored, n in zip(base, grids, *clock.errors(grids), rows, strict=True)
    ]
    lags, taus = [], []
    for b, grid, n in zip(base, grids, rows, strict=True):
        true, decoy = (
            cells[np.argmin(grid.blocks[:, cells].sum(axis=0))] for cells in (grid.lag, grid.reversed_lag)
        )
        lags.append(
            JointErrors(
                b, b - grid.unmoved + grid.blocks[:, true], b - grid.unmoved + grid.blocks[:, decoy], n
            )
        )
        taus.append(np.array([grid.cells[true, 1]]))
    nothing = tuple(np.empty(0) for _ in grids)
    shifts = tuple(clock.offset_s for _ in grids)
    return [
        Assessment("clock_offset", direction.rotations, tuple(offsets), shifts, nothing, None, ("offset_s",)),
        Assessment("lag", direction.rotations, tuple(lags), tuple(taus), nothing, None, ("tau_s",)),
    ]


def _held_out_blocks(direction: Direction, joint: int) -> np.ndarray:
    residual = direction.products[joint].residual
    return _blocks(residual, block_starts([len(part) for part in residual], BLOCK_ROWS))
