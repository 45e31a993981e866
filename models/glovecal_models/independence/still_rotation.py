"""Which rotations were kept still in a take, and whether they were."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand_ranges import ACTIVE_RANGE_DEG
from glovecal_models.independence.smooth_readings import SmoothTake, span
from glovecal_models.independence.take_names import rotation_in_name
from glovecal_models.layout import Layout

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
        if own_sensor(layout, said) is None:
            raise BadInput(
                f"rotation {said} has no sensor of its own in layout {layout.name!r}: there is nothing to "
                "examine"
            )
        return (said,)
    found = tuple(
        rotation
        for rotation in layout.rotations
        if own_sensor(layout, rotation) is not None
        and (how := stillness(item, rotation)) is not None
        and how.is_still
    )
    if not found:
        having = [rotation for rotation in layout.rotations if own_sensor(layout, rotation) is not None]
        if not having:
            raise BadInput(f"no rotation of layout {layout.name!r} has a sensor of its own to examine")
        raise BadInput(
            f"take {item.take.name!r} does not tell which rotation was kept still, and no measured rotation "
            f"was; call it like still-{having[0]}, or say which it was"
        )
    return found


def own_sensor(layout: Layout, rotation: str) -> str | None:
    """The sensor that is there to measure a rotation: of its name, else the only one it is read from; None
    for a rotation without a sensor, or one that several sensors of other names share."""
    item = layout.correspondence(rotation)
    if item.simulated is None and rotation in item.sensors:
        return rotation
    return item.sensors[0] if item.kind == "1S1R" else None
