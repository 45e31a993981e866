"""Whether faults can be seen live, without a reference: learned from some takes, held against the others."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.effects.base.effect import Settings
from glovecal_models.effects.base.signature_effect import Finding, frames_inside
from glovecal_models.effects.sensor_fault.fault_limits import fault_limits
from glovecal_models.effects.sensor_fault.fault_watch import FaultLimits, FaultWatch
from glovecal_models.effects.sensor_fault.sensor_fault import SensorFault
from glovecal_models.errors import Cancelled
from glovecal_models.regression.rule_regressor import RuleRegressor
from glovecal_models.takes.take import Take

PARTS = 3
MOST_FALSE = 0.01
"""Share of sound readings flagged: with more a live flag would be no news."""


@dataclass(frozen=True)
class LiveFaults:
    """What is served, and how well it did on takes that it was not learned from."""

    live: Settings | None
    """Settings of the watch; None when it cannot tell a fault from a movement here."""
    faulty_frames: int
    """Readings that are faulty when held against the reference."""
    frames: int
    seen_share: float
    """Of the faulty readings."""
    false_share: float
    """Of the others."""

    @property
    def sentence(self) -> str:
        share = 100 * self.faulty_frames / max(self.frames, 1)
        left_out = (
            f"{self.faulty_frames} faulty readings ({share:.1f} % of the failing sensors') are left out of "
            "training and of the comparison"
        )
        told = (
            f"{100 * self.seen_share:.0f} % of the faulty readings and {100 * self.false_share:.2f} % of the "
            "sound ones"
        )
        if self.live is None:
            return f"{left_out}. Live they are not flagged: that would flag {told}."
        return (
            f"{left_out}. Live poses hold the last good angle there, with a flag: {told} on takes left out."
        )

    def to_document(self) -> dict[str, float]:
        """Plain JSON-able data."""
        return {
            "faulty_frames": self.faulty_frames,
            "frames": self.frames,
            "live_seen_share": self.seen_share,
            "live_false_share": self.false_share,
        }


def live_faults(
    model: CalibrationModel,
    takes: Sequence[Take],
    sensor_of: Mapping[str, str],
    cancelled: Callable[[], bool] | None = None,
) -> LiveFaults:
    """``takes`` with their faults. Raises BadInput for a sensor that a take lacks, Cancelled."""
    sensors, found = model.layout.sensors, SensorFault().find(takes, sensor_of)
    reads = {
        item.rotation: item.correspondence.sensors
        for item in model.rotations
        if not isinstance(item.regressor, RuleRegressor)
    }
    marks = [_marked(take, sensors, found) for take in takes]
    failing = np.any([mark.any(axis=0) for mark in marks], axis=0)
    seen = false = faulty = sound = 0
    for part in range(min(PARTS, len(takes))):
        if cancelled and cancelled():
            raise Cancelled("adding an effect was cancelled")
        kept = [take for number, take in enumerate(takes) if number % PARTS != part] or list(takes)
        limits = fault_limits(kept, sensors, SensorFault().find(kept, sensor_of), reads)
        for take, mark in list(zip(takes, marks, strict=True))[part::PARTS]:
            flagged = _flagged(take, limits, sensors)
            seen, faulty = seen + int((flagged & mark).sum()), faulty + int(mark.sum())
            false, sound = false + int((flagged & ~mark).sum()), sound + int((~mark).sum())
    false_share = false / max(sound, 1)
    frames = int(failing.sum()) * sum(len(take.time_s) for take in takes)
    live = fault_limits(takes, sensors, found, reads).to_settings() if false_share <= MOST_FALSE else None
    return LiveFaults(live, faulty, frames, seen / max(faulty, 1), false_share)


def _marked(take: Take, sensors: Sequence[str], found: Sequence[Finding]) -> np.ndarray:
    """(N, S) True where the reference shows a fault that passes; after a jump for good readings are sound."""
    marks = np.zeros((len(take.time_s), len(sensors)), dtype=bool)
    for item in found:
        for name in item.where:
            if item.kind != "jump":
                marks[:, list(sensors).index(name)] |= frames_inside(take, item.stretches)
    return marks


def _flagged(take: Take, limits: FaultLimits, sensors: Sequence[str]) -> np.ndarray:
    """(N, S) True where the watch sees a fault."""
    readings = take.readings[:, [take.sensors.index(name) for name in sensors]]
    watch = FaultWatch(limits, sensors)
    frames = zip(take.time_s, readings, strict=True)
    return np.stack([watch.frame(float(time_s), row)[1] > 0.0 for time_s, row in frames])
