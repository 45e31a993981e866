"""Sensors that never change in the takes: rotations that have others to be read from are read from those."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from glovecal_models.calibration.samples import require_layout
from glovecal_models.layout import Correspondence, Layout
from glovecal_models.takes.take import Take


def without_dead_sensors(layout: Layout, takes: Sequence[Take]) -> tuple[Layout, tuple[str, ...]]:
    """The layout, and the dead sensors that nothing is read from any more.

    A rotation whose own sensor is dead keeps it: that is to be refused, not passed over. Raises
    LayoutMismatch.
    """
    for take in takes:
        require_layout(take, layout)
    dead = {name for name in layout.sensors if _never_changes(name, takes)}
    reduced = tuple(_reduced(item, dead) for item in layout.correspondences)
    left_out = {
        name
        for before, after in zip(layout.correspondences, reduced, strict=True)
        for name in set(before.sensors) - set(after.sensors)
    }
    if not left_out:
        return layout, ()
    return replace(layout, correspondences=reduced), tuple(n for n in layout.sensors if n in left_out)


def dead_sensors_sentence(dead: Sequence[str]) -> str:
    """What was left out, and why."""
    one = len(dead) == 1
    return (
        f"Sensor{'' if one else 's'} {', '.join(dead)} never change{'s' if one else ''} in these takes and"
        f" {'was' if one else 'were'} left out. Is a wire broken?"
    )


def _never_changes(name: str, takes: Sequence[Take]) -> bool:
    columns = [take.readings[:, take.sensors.index(name)] for take in takes if len(take.time_s)]
    return bool(columns) and float(np.ptp(np.concatenate(columns))) == 0.0


def _reduced(item: Correspondence, dead: set[str]) -> Correspondence:
    living = tuple(name for name in item.sensors if name not in dead)
    if item.simulated is not None or not living or item.rotation in dead or living == item.sensors:
        return item
    kind = item.kind if item.kind == "MSMR" or len(living) > 1 else "1S1R"
    return replace(item, sensors=living, kind=kind)
