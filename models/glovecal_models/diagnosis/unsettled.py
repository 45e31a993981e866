"""What may be judged of a residual beside effects that remember: not what their unknown start left.

Nobody recorded what a joint did before a take, so the state of a memory starts as a guess, and the error of
that guess stays until the effect has settled (``Effect.transient_s``): an offset of the take that slowly
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
    settles_s = [
        max((item.settles_after_s(design.signals, joint, name) for item in known), default=0.0)
        for joint, name in enumerate(design.rotations)
    ]
    if not any(settles_s):
        return design
    judged = [_judged(design, joint, seconds) for joint, seconds in enumerate(settles_s)]
    used, products = zip(*judged, strict=True)
    return replace(design, used=used, products=products, kept={})


def unsettled_effects(design: ForwardDesign, known: Sequence[KnownEffect]) -> tuple[str, ...]:
    """Names of those that settle in none of the takes: nothing is known of offsets of whole takes."""
    longest = max((float(np.ptp(take.time_s)) for take in design.signals if len(take)), default=0.0)
    found = [
        item.effect.name
        for item in known
        for joint, name in enumerate(design.rotations)
        if item.settles_after_s(design.signals, joint, name) >= longest
    ]
    return tuple(dict.fromkeys(found))


def _judged(
    design: ForwardDesign, joint: int, settles_s: float
) -> tuple[tuple[np.ndarray, ...], BaseProducts]:
    """The rows of each unit and what the base leaves there, of one joint."""
    products = copy.copy(design.products[joint])
    used, units, residuals = [], [], []
    parts = zip(design.units(joint), products.units, products.residual, strict=True)
    for (take, rows), unit, residual in parts:
        left = _left(design.signals[take].time_s, rows, residual, settles_s)
        kept = np.isfinite(left)
        used.append(rows[kept])
        weight = None if unit.weight is None else unit.weight[kept]
        units.append(replace(unit, base=unit.base[kept], target=unit.target[kept], weight=weight))
        residuals.append(left[kept])
    products.units, products.residual = units, tuple(residuals)
    return tuple(used), products


def _left(time_s: np.ndarray, rows: np.ndarray, residual: np.ndarray, settles_s: float) -> np.ndarray:
    """(N,) at the ``rows`` of a take of ``time_s``, NaN where nothing can be judged; a gap starts the memory
    anew."""
    result = residual.copy()
    for part in unbroken(time_s) if settles_s > 0.0 else ():
        since = time_s[rows] - time_s[part.start]
        early = (rows >= part.start) & (rows < part.stop) & (since < settles_s)
        at = since[early]
        if not len(at):
            continue
        if np.ptp(at) < SHORTEST_LINE_S:
            result[early] = np.nan
        else:
            result[early] -= np.polyval(np.polyfit(at, result[early], 1), at)
    return result
