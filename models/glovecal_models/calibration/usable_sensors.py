"""Training without dead sensors: rotations that have others are read from those."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from glovecal_models.calibration.samples import require_layout
from glovecal_models.layout import Correspondence, Layout
from glovecal_models.takes.dead_sensor import DeadSensor, dead_sensors
from glovecal_models.takes.take import Take


@dataclass(frozen=True)
class UsableSensors:
    """What is left of a layout. The glove still sends all its sensors: only what is read of them changes."""

    layout: Layout
    """The same sensors; rotations are read from those that live."""
    dead: tuple[DeadSensor, ...]
    """Of the sensors that some rotation was read from."""
    unreadable: tuple[str, ...]
    """Rotations whose own sensor, or every sensor, is dead; they keep their correspondence."""


def usable_sensors(layout: Layout, takes: Sequence[Take]) -> UsableSensors:
    """Raises LayoutMismatch unless every take has every sensor of the layout."""
    for take in takes:
        require_layout(take, layout)
    found = dead_sensors(takes, layout.sensors) if takes else ()
    dead = {item.sensor for item in found}
    reduced = [_reduced(item, dead) for item in layout.correspondences]
    read = {name for item in layout.correspondences for name in item.sensors}
    kept = (now or before for now, before in zip(reduced, layout.correspondences, strict=True))
    return UsableSensors(
        replace(layout, correspondences=tuple(kept)) if dead & read else layout,
        tuple(item for item in found if item.sensor in read),
        tuple(name for name, now in zip(layout.rotations, reduced, strict=True) if now is None),
    )


def _reduced(item: Correspondence, dead: set[str]) -> Correspondence | None:
    living = tuple(name for name in item.sensors if name not in dead)
    if living == item.sensors:
        return item
    if item.simulated is not None or not living or item.rotation in dead:
        return None
    kind = item.kind if item.kind == "MSMR" or len(living) > 1 else "1S1R"
    return replace(item, sensors=living, kind=kind)
