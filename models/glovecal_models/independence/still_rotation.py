"""Which rotations were kept still in a take, by its name or by measured angles, and whether they were.

``still-im_abd`` keeps IM_ABD still, ``still-IM_ABD-move-I_MCP`` moves only I_MCP, ``range IM_ABD`` takes
IM_ABD through its range.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand_ranges import ACTIVE_RANGE_DEG
from glovecal_models.independence.smooth_readings import SmoothTake, span
from glovecal_models.layout import Layout


def rotation_in_name(name: str, rotations: Sequence[str]) -> str | None:
    """The longest of ``rotations`` that stands by itself in the name, before any "move"; or None."""
    found = _found(_words(name).partition("_move_")[0] + "_", rotations)
    return max(found, key=len, default=None)


def moved_in_name(name: str, rotations: Sequence[str]) -> tuple[str, ...]:
    """The rotations that stand after "move" in the name."""
    return tuple(_found("_" + _words(name).partition("_move_")[2], rotations))


def _words(name: str) -> str:
    return f"_{re.sub(r'[^0-9a-z]+', '_', name.lower())}_"


def _found(words: str, rotations: Sequence[str]) -> list[str]:
    """Longer names first, so that MCP is not found in I_MCP."""
    found = []
    for rotation in sorted(rotations, key=len, reverse=True):
        if f"_{rotation.lower()}_" in words:
            found.append(rotation)
            words = words.replace(f"_{rotation.lower()}_", "_/_")
    return found


STILL_STD_PCT, STILL_SPAN_PCT = 3.0, 10.0
"""Of the joint's active range: what a joint kept still moves all the same."""
USUAL_RANGE_DEG = 60.0
"""For a rotation that no hand is known to have (an ankle's)."""


@dataclass(frozen=True)
class Stillness:
    """How much a rotation moved that was to be kept still, by measured angles, per cent of its range."""

    std_pct: float
    span_pct: float

    @property
    def is_still(self) -> bool:
        return self.std_pct <= STILL_STD_PCT and self.span_pct <= STILL_SPAN_PCT


def stillness(item: SmoothTake, rotation: str) -> Stillness | None:
    """None where the rotation was not measured."""
    angles = item.angle(rotation)
    if angles is None:
        return None
    low, high = ACTIVE_RANGE_DEG.get(rotation, (0.0, USUAL_RANGE_DEG))
    scale = 100 / (high - low)
    return Stillness(scale * float(np.nanstd(angles)), scale * span(angles))


def still_rotations(item: SmoothTake, layout: Layout, named: str | None = None) -> tuple[str, ...]:
    """The rotation that was named, that the take's name speaks of, or all that were measured as still.

    Raises BadInput when none of these tells, or the rotation has no sensor of its own.
    """
    said = named or rotation_in_name(item.take.name, layout.rotations)
    if said is not None:
        if layout.correspondence(said).measuring_sensor is None:
            raise BadInput(
                f"rotation {said} has no sensor of its own in layout {layout.name!r}: there is nothing to "
                "examine"
            )
        return (said,)
    having = [one.rotation for one in layout.correspondences if one.measuring_sensor is not None]
    found = tuple(name for name in having if (how := stillness(item, name)) is not None and how.is_still)
    if not found:
        if not having:
            raise BadInput(f"no rotation of layout {layout.name!r} has a sensor of its own to examine")
        raise BadInput(
            f"take {item.take.name!r} does not tell which rotation was kept still, and no measured rotation "
            f"was; call it like still-{having[0]}, or say which it was"
        )
    return found
