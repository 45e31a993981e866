"""Training without dead sensors: rotations that have others to be read from are read from those."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from glovecal_models.calibration.samples import require_layout
from glovecal_models.layout import Correspondence, Layout
from glovecal_models.takes.dead_sensor import DeadSensor, dead_sensors
from glovecal_models.takes.take import Take


@dataclass(frozen=True)
class LivingSensors:
    """What is left of a layout. The glove still sends all its sensors: only what is read of them changes."""

    layout: Layout
    """The same sensors; rotations are read from those that live."""
    left_out: tuple[DeadSensor, ...]
    """Of the sensors that some rotation was read from."""
    unreadable: tuple[str, ...]
    """Rotations whose own sensor, or every sensor, is dead; they keep their correspondence."""

    def sentences(self, rotations: Sequence[str]) -> list[str]:
        """What was left out, and why; ``rotations``: those that could have been trained."""
        if not self.left_out:
            return []
        each = ", ".join(map(str, self.left_out))
        several = len(self.left_out) > 1
        told = [
            f"Sensor{'s' * several} {each} say{'' if several else 's'} nothing of the hand in these takes:"
            " left out of training, rotations are read from the others. Is a wire broken?"
        ]
        lost = [name for name in self.unreadable if name in rotations]
        if lost:
            told.append(f"{', '.join(lost)}: left out of the model, as no living sensor measures it.")
        return told


def living_sensors(layout: Layout, takes: Sequence[Take]) -> LivingSensors:
    """Raises LayoutMismatch unless every take has every sensor of the layout."""
    for take in takes:
        require_layout(take, layout)
    found = dead_sensors(takes, layout.sensors) if takes else ()
    dead = {item.sensor for item in found}
    reduced = [_reduced(item, dead) for item in layout.correspondences]
    read = {name for item in layout.correspondences for name in item.sensors}
    kept = (now or before for now, before in zip(reduced, layout.correspondences, strict=True))
    return LivingSensors(
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
