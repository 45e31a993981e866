"""Every effect that could be missing, assessed on the same rows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.diagnosis.assessment import LEAST_CONTRAST, Assessment, JointErrors
from glovecal_models.diagnosis.delays import DelayErrors, block_starts, delay_errors
from glovecal_models.diagnosis.directions import Direction
from glovecal_models.diagnosis.held_out import HeldOut
from glovecal_models.diagnosis.screening import Evidence, screen
from glovecal_models.diagnosis.session_chance import session_probability
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
    report: Callable[[str, float], None] | None = None,
) -> tuple[list[Assessment], list[NotJudgeable]]:
    """Every judgeable effect, and why the others are not. ``lag`` brings ``clock_offset`` with it."""
    found: list[Assessment] = []
    impossible: list[NotJudgeable] = []
    for number, effect in enumerate(effects):
        if report:
            report(f"trying {effect.name}", number / len(effects))
        why = effect.missing(direction.signals)
        if why is not None:
            impossible.append(NotJudgeable(effect.name, why))
        elif effect.name == "lag":
            found.extend(_delays(direction))
        else:
            found.append(_assessed(direction, effect, generator))
    return found, impossible


def _assessed(direction: Direction, effect: Effect, generator: np.random.Generator) -> Assessment:
    evidence = screen(direction, effect, generator)
    errors = tuple(_joint_errors(item) for item in evidence)
    probability = None
    if effect.decoy in SESSION_DECOYS:
        some = [i for i, item in enumerate(errors) if item.contrast >= LEAST_CONTRAST]
        probability = 1.0
        if some:
            found = session_probability(direction, effect, some, generator)
            probability = 1.0 if found is None else found
    return Assessment(
        effect.name,
        direction.rotations,
        errors,
        tuple(item.shape for item in evidence),
        tuple(item.true.weights for item in evidence),
        probability,
    )


def _joint_errors(evidence: Evidence) -> JointErrors:
    true, decoy = evidence.true, evidence.decoy
    starts = block_starts([len(part) for part in true.residual], BLOCK_ROWS)
    return JointErrors(
        _blocks(true.residual, starts),
        _blocks(true.residual_added, starts),
        _blocks(decoy.residual_added, starts),
        int(true.count.sum()),
    )


def _blocks(residual: Sequence[np.ndarray], starts: np.ndarray) -> np.ndarray:
    return np.add.reduceat(np.concatenate(residual) ** 2, starts)


def _delays(direction: Direction) -> list[Assessment]:
    """Lag, each joint its own; clock offset, one for all."""
    grids = delay_errors(direction, BLOCK_ROWS)
    clock = grids[0].clock
    each = np.array([grid.blocks[:, clock].sum(axis=0) / grid.unmoved.sum() for grid in grids])
    shift = int(np.argmin(each.sum(axis=0)))
    mirrored = len(clock) - 1 - shift
    offsets, lags = [], []
    for joint, grid in enumerate(grids):
        base = _held_out_blocks(direction, joint)
        offsets.append(_moved(grid, base, clock[shift], clock[mirrored], direction, joint))
        best, worst = (
            cells[np.argmin(grid.blocks[:, cells].sum(axis=0))] for cells in (grid.lag, grid.reversed_lag)
        )
        lags.append(_moved(grid, base, best, worst, direction, joint))
    delay = grids[0].cells[clock[shift], 0]
    taus = [grid.cells[grid.lag[np.argmin(grid.blocks[:, grid.lag].sum(axis=0))], 1] for grid in grids]
    nothing = tuple(np.empty(0) for _ in grids)
    return [
        Assessment(
            "clock_offset",
            direction.rotations,
            tuple(offsets),
            tuple(np.array([delay]) for _ in grids),
            nothing,
        ),
        Assessment("lag", direction.rotations, tuple(lags), tuple(np.array([tau]) for tau in taus), nothing),
    ]


def _held_out_blocks(direction: Direction, joint: int) -> np.ndarray:
    residual = direction.products[joint].residual
    return _blocks(residual, block_starts([len(part) for part in residual], BLOCK_ROWS))


def _moved(
    grid: DelayErrors, base: np.ndarray, cell: int, decoy: int, direction: Direction, joint: int
) -> JointErrors:
    """What a delay saves in the fit, taken from the held-out error: it has one number, no flexibility."""
    return JointErrors(
        base,
        base - grid.unmoved + grid.blocks[:, cell],
        base - grid.unmoved + grid.blocks[:, decoy],
        int(direction.products[joint].count.sum()),
    )
