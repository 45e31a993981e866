"""Every effect that could be missing, assessed on the same rows."""

from __future__ import annotations

from collections.abc import Callable, Sequence, Set
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.diagnosis.assessment import LEAST_SESSION_CONTRAST, Assessment, JointErrors
from glovecal_models.diagnosis.delay_verdict import clock_choice
from glovecal_models.diagnosis.delays import block_starts, delay_errors
from glovecal_models.diagnosis.directions import Direction
from glovecal_models.diagnosis.next_take import NextTake
from glovecal_models.diagnosis.screening import Evidence, screen
from glovecal_models.diagnosis.session_chance import session_probability
from glovecal_models.diagnosis.undecidable import undecidable
from glovecal_models.effects.base.columnless_effect import ColumnlessEffect
from glovecal_models.effects.base.effect import Effect

BLOCK_ROWS = 125
"""5 s of the rows that are fitted."""
DEALS_TRIED = 5
SESSION_DECOYS = ("context of other takes", "dealt wearings")


@dataclass(frozen=True)
class NotJudgeable:
    """An effect these takes cannot show."""

    effect: str
    why: str
    record: NextTake | None = None
    """The recording after which they could."""
    would_save: Assessment | None = None
    """What it saves on takes left out, by itself or by chance."""

    @property
    def joints_saved(self) -> tuple[int, ...]:
        """Joints on which it saves as much as a session effect must."""
        if self.would_save is None:
            return ()
        errors = self.would_save.errors
        return tuple(i for i, item in enumerate(errors) if item.saved >= LEAST_SESSION_CONTRAST)

    @property
    def saves_much(self) -> bool:
        """Whether it may well be there."""
        return bool(self.joints_saved)

    @property
    def saved_square(self) -> float:
        """Squared degrees per row, summed over those joints."""
        if self.would_save is None:
            return 0.0
        some = [self.would_save.errors[i] for i in self.joints_saved]
        return float(sum((item.base.sum() - item.added.sum()) / item.rows for item in some))


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
            impossible.append(NotJudgeable(effect.name, _with_advice(effect, why)))
        elif effect.name == "lag":
            found.extend(item for item in _delays(direction) if item.effect not in without)
        else:
            item = _assessed(direction, effect, generator)
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
    direction: Direction, effect: Effect, generator: np.random.Generator
) -> Assessment | NotJudgeable:
    evidence = _screened(direction, effect, generator)
    errors = tuple(_joint_errors(item, np.array(direction.unit_take)) for item in evidence)
    found = Assessment(
        effect.name,
        direction.rotations,
        errors,
        tuple(item.shape for item in evidence),
        tuple(item.true.weights for item in evidence),
        None,
        tuple(f"{item.name}_{item.unit}" for item in effect.parameters),
    )
    if effect.decoy not in SESSION_DECOYS:
        return found
    few = undecidable(direction.signals, effect)
    if few is not None:
        return NotJudgeable(effect.name, few.why, few.record, found)
    some = any(item.contrast >= LEAST_SESSION_CONTRAST for item in errors)
    return replace(found, probability=session_probability(direction, effect, generator) if some else 1.0)


def _screened(direction: Direction, effect: Effect, generator: np.random.Generator) -> tuple[Evidence, ...]:
    """With one decoy; of dealt wearings the typical of several: one deal may nearly be the true one."""
    if effect.decoy != "dealt wearings":
        return screen(direction, effect, generator)
    tried = [screen(direction, effect, generator) for _ in range(DEALS_TRIED)]
    middle = [
        sorted(items, key=lambda item: item.decoy.saved)[DEALS_TRIED // 2]
        for items in zip(*tried, strict=True)
    ]
    return tuple(middle)


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
        JointErrors(b, b - grid.unmoved + moved, b - grid.unmoved + mirrored, n, grid.take)
        for b, grid, moved, mirrored, n in zip(base, grids, *clock.errors(grids), rows, strict=True)
    ]
    lags, taus = [], []
    for b, grid, n in zip(base, grids, rows, strict=True):
        true, decoy = (
            cells[np.argmin(grid.blocks[:, cells].sum(axis=0))] for cells in (grid.lag, grid.reversed_lag)
        )
        lags.append(
            JointErrors(
                b,
                b - grid.unmoved + grid.blocks[:, true],
                b - grid.unmoved + grid.blocks[:, decoy],
                n,
                grid.take,
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
