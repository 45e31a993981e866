"""What may be judged of a residual beside effects that remember: not what their unknown start left.

Nobody recorded what a joint did before a take, so the state of a memory starts as a guess, and the error of
that guess stays until the effect has settled (``HistoryEffect.unsettled``): an offset of the take that slowly
changes. It is the effect's own, neither noise nor another cause. Until then the mean and the straight line of
the error are not judged, and stretches too short for a line not at all.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from glovecal_models.calibration.held_out import BaseProducts
from glovecal_models.diagnosis.forward_design import ForwardDesign
from glovecal_models.diagnosis.known_effect import KnownEffect
from glovecal_models.effects.base.history_effect import unbroken

SHORTEST_LINE_S = 4.0
"""As the shortest take of which a slow error is judged."""


def without_unsettled(design: ForwardDesign, known: Sequence[KnownEffect]) -> ForwardDesign:
    """The design with those rows and residuals that can be judged; the same where nothing remembers."""
    masks = [_unsettled(design, known, joint) for joint in range(len(design.rotations))]
    if not any(masks):
        return design
    judged = [_judged(design, joint, mask) for joint, mask in enumerate(masks)]
    used, products = zip(*judged, strict=True)
    return replace(design, used=used, products=products, kept={})


def unsettled_effects(design: ForwardDesign, known: Sequence[KnownEffect]) -> tuple[str, ...]:
    """Names of those that settle in none of the takes: nothing is known of offsets of whole takes."""
    found = [
        item.effect.name
        for item in known
        for joint in range(len(design.rotations))
        if (masks := _unsettled(design, [item], joint)) and all(mask.all() for mask in masks)
    ]
    return tuple(dict.fromkeys(found))


def _unsettled(design: ForwardDesign, known: Sequence[KnownEffect], joint: int) -> list[np.ndarray]:
    """For each take (N,) where an effect on a joint has not settled; empty where none remembers."""
    name = design.rotations[joint]
    every = [item.unsettled(design.signals, joint, name) for item in known]
    return [np.any(masks, axis=0) for masks in zip(*(each for each in every if each), strict=True)]


def _judged(
    design: ForwardDesign, joint: int, masks: Sequence[np.ndarray]
) -> tuple[tuple[np.ndarray, ...], BaseProducts]:
    """The rows of each unit and what the base leaves there, of one joint; ``masks`` of its takes, or none."""
    products = copy.copy(design.products[joint])
    if not masks:
        return design.used[joint], products
    used, units, residuals = [], [], []
    parts = zip(design.units(joint), products.units, products.residual, strict=True)
    for (take, rows), unit, residual in parts:
        left = _left(design.signals[take].time_s, rows, residual, masks[take])
        kept = np.isfinite(left)
        used.append(rows[kept])
        weight = None if unit.weight is None else unit.weight[kept]
        units.append(replace(unit, base=unit.base[kept], target=unit.target[kept], weight=weight))
        residuals.append(left[kept])
    products.units, products.residual = units, tuple(residuals)
    return tuple(used), products


def _left(time_s: np.ndarray, rows: np.ndarray, residual: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """(M,) at the ``rows`` of a take of ``time_s`` (N,), NaN where nothing can be judged; ``mask`` (N,) is
    True where effects have not settled, which they begin anew after a gap."""
    result = residual.copy()
    for part in unbroken(time_s):
        early = (rows >= part.start) & (rows < part.stop) & mask[rows]
        at = time_s[rows[early]]
        if not len(at):
            continue
        if np.ptp(at) < SHORTEST_LINE_S:
            result[early] = np.nan
        else:
            result[early] -= np.polyval(np.polyfit(at - at[0], result[early], 1), at - at[0])
    return result
