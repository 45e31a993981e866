"""The shape of an effect: what its columns do not depend on linearly, tried on a grid, then more finely."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.calibration.effect_request import EffectRequest
from glovecal_models.calibration.held_out import BaseProducts, FittedColumns, FittedRows, Rows, held_out
from glovecal_models.effects.base.facts import Settings
from glovecal_models.effects.base.signals import Signals

REFINEMENTS = 2
"""Rounds of trying shapes between the best of a grid and its neighbours."""


@dataclass(frozen=True)
class EffectGroup:
    """Lanes of one effect that share settings."""

    wanted: EffectRequest
    lanes: tuple[str, ...]
    signals: list[Signals]
    settings: Settings


def best_shape(
    group: EffectGroup,
    rows: Mapping[str, Sequence[np.ndarray]],
    bases: Mapping[str, list[Rows]],
    extra: Mapping[str, list[list[np.ndarray]]],
    *,
    refinements: int = REFINEMENTS,
) -> np.ndarray:
    """(L, P): the best of the effect's grid, then of ``refinements`` finer ones around it."""
    effect, settings = group.wanted.effect, group.settings
    grid = effect.grid(group.signals, settings)
    if grid.shape[0] == 1 or grid.shape[2] == 0:
        return grid[0]
    products = {
        name: BaseProducts(
            [
                replace(unit, base=np.column_stack([unit.base, *(parts[u] for parts in extra[name])]))
                for u, unit in enumerate(bases[name])
            ]
        )
        for name in group.lanes
    }
    prior = effect.prior_sd(settings)
    units = [list(enumerate(rows[name])) for name in group.lanes]
    fitted = FittedRows.of([len(take) for take in group.signals], units)
    best = np.zeros((len(group.lanes), grid.shape[2]))
    for _ in range(1 + refinements):
        shapes, lanes, numbers = grid.shape
        flat = grid.reshape(shapes * lanes, numbers)
        tiled = [_tiled(take, shapes) for take in group.signals]
        found = FittedColumns.of(effect.columns_of_takes(tiled, settings, flat), fitted)
        for lane, name in enumerate(group.lanes):
            best[lane] = grid[held_out(products[name], found.units(lane), prior).shape, lane]
        grid = _finer(grid, best)
    return best


def _tiled(take: Signals, times: int) -> Signals:
    zero = None if take.zero_deg is None else np.tile(take.zero_deg, times)
    return Signals(
        take.time_s,
        np.tile(take.own, (1, times)),
        take.others,
        take.context,
        take.wearing,
        take.take,
        zero,
    )


def _finer(grid: np.ndarray, best: np.ndarray) -> np.ndarray:
    """Shapes between the best and its neighbours in ``grid``, by ratios; (5, L, P)."""
    result = np.empty((5, *best.shape))
    for lane in range(best.shape[0]):
        at = int(
            np.argmin(
                np.abs(np.log(np.maximum(grid[:, lane], 1e-9) / np.maximum(best[lane], 1e-9))).sum(axis=1)
            )
        )
        low, high = grid[max(at - 1, 0), lane], grid[min(at + 1, len(grid) - 1), lane]
        for row, share in enumerate((-2 / 3, -1 / 3, 0.0, 1 / 3, 2 / 3)):
            end = high if share > 0 else low
            result[row, lane] = best[lane] * (np.maximum(end, 1e-9) / np.maximum(best[lane], 1e-9)) ** abs(
                share
            )
    order = np.argsort(result[:, :, :1].mean(axis=(1, 2)))
    return result[order]
