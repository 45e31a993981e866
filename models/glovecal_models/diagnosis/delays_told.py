"""Lag or clock offset: the delays that lead a ranking, put in the right order."""

from __future__ import annotations

from dataclasses import replace

from glovecal_models.diagnosis.candidates import BLOCK_ROWS
from glovecal_models.diagnosis.delay_verdict import MIDDLE, SHAPE_SMOOTHING, delay_kind
from glovecal_models.diagnosis.delays import delay_errors
from glovecal_models.diagnosis.directions import Direction
from glovecal_models.diagnosis.ground import Ground
from glovecal_models.diagnosis.naming import Naming

DELAYS = ("lag", "clock_offset")


def delays_told(naming: Naming, ground: Ground, direction: Direction) -> Naming:
    """``direction`` is that of ``ground``; a ranking that no delay leads stays as it is."""
    if not naming.ranked or naming.ranked[0].effect not in DELAYS:
        return naming
    strong = ground.direction(SHAPE_SMOOTHING)
    kind, score = delay_kind(delay_errors(direction, BLOCK_ROWS), delay_errors(strong, BLOCK_ROWS))
    first = kind if kind != "either" else "lag" if score > MIDDLE else "clock_offset"
    delays = [item for item in naming.ranked if item.effect in DELAYS]
    if first not in {item.effect for item in delays}:
        return naming
    delays.sort(key=lambda item: item.effect != first)
    others = [item for item in naming.ranked if item.effect not in DELAYS]
    kept = [name for name in naming.confidence_set if name not in DELAYS]
    told = DELAYS if kind == "either" else (first,)
    return replace(
        naming,
        ranked=(*delays, *others),
        confidence_set=(first, *(name for name in told if name != first), *kept),
    )
