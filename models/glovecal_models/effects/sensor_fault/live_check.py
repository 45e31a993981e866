"""Whether faults can be seen live, without a reference: learned from some takes, held against the others."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from glovecal_models.effects.base.signature_effect import Finding, LiveCheck, frames_inside
from glovecal_models.effects.sensor_fault.fault_limits import LASTING, fault_limits
from glovecal_models.effects.sensor_fault.fault_watch import FaultLimits, FaultWatch
from glovecal_models.progress import Cancel, stop_if
from glovecal_models.takes.take import Take

PARTS = 3
MOST_FALSE = 0.01
"""Share of sound readings flagged: with more a live flag would be no news."""


Found = Callable[[Sequence[Take]], Sequence[Finding]]
"""The faults that takes with reference show."""


def live_check(
    takes: Sequence[Take],
    sensors: Sequence[str],
    reads: Mapping[str, tuple[str, ...]],
    find: Found,
    cancelled: Cancel | None = None,
) -> LiveCheck:
    """``takes`` with their faults. Raises BadInput for a sensor that a take lacks, Cancelled."""
    found = find(takes)
    marks = [_marked(take, sensors, found) for take in takes]
    failing = np.any([mark.any(axis=0) for mark in marks], axis=0)
    seen = false = faulty = sound = 0
    for part in range(min(PARTS, len(takes))):
        stop_if(cancelled, "adding an effect")
        kept = [take for number, take in enumerate(takes) if number % PARTS != part] or list(takes)
        limits = fault_limits(kept, sensors, find(kept), reads)
        for take, mark in list(zip(takes, marks, strict=True))[part::PARTS]:
            flagged = _flagged(take, limits, sensors)
            seen, faulty = seen + int((flagged & mark).sum()), faulty + int(mark.sum())
            false, sound = false + int((flagged & ~mark).sum()), sound + int((~mark).sum())
    frames = int(failing.sum()) * sum(len(take.time_s) for take in takes)
    seen_share, false_share = seen / max(faulty, 1), false / max(sound, 1)
    is_served = false_share <= MOST_FALSE
    evidence = {
        "faulty_frames": faulty,
        "frames": frames,
        "live_seen_share": seen_share,
        "live_false_share": false_share,
    }
    return LiveCheck(
        {"live": fault_limits(takes, sensors, found, reads).to_settings()} if is_served else {},
        _sentence(evidence, is_served),
        evidence,
    )


def _sentence(evidence: Mapping[str, float], is_served: bool) -> str:
    share = 100 * evidence["faulty_frames"] / max(evidence["frames"], 1)
    excluded = (
        f"{evidence['faulty_frames']} faulty readings ({share:.1f} % of the failing sensors') are"
        " excluded from training and comparison"
    )
    flagged = (
        f"{100 * evidence['live_seen_share']:.0f} % of the faulty readings and "
        f"{100 * evidence['live_false_share']:.2f} % of the sound ones"
    )
    if not is_served:
        return f"{excluded}. They are not flagged live: that would flag {flagged}."
    return (
        f"{excluded}. Live poses hold the last good angle there, with a flag ({flagged} on held-out takes)."
    )


def _marked(take: Take, sensors: Sequence[str], found: Sequence[Finding]) -> np.ndarray:
    """(N, S) True where the reference shows a fault that passes; after a lasting one readings are sound."""
    marks = np.zeros((len(take.time_s), len(sensors)), dtype=bool)
    for item in found:
        for name in item.where:
            if item.kind not in LASTING:
                marks[:, list(sensors).index(name)] |= frames_inside(take, item.stretches)
    return marks


def _flagged(take: Take, limits: FaultLimits, sensors: Sequence[str]) -> np.ndarray:
    """(N, S) True where the watch sees a fault."""
    readings = take.readings[:, [take.sensors.index(name) for name in sensors]]
    watch = FaultWatch(limits, sensors)
    frames = zip(take.time_s, readings, strict=True)
    return np.stack([watch.frame(float(time_s), row)[1] > 0.0 for time_s, row in frames])
