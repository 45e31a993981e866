"""Whether faults can be seen live, without a reference: learned from some takes, held against the others."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from glovecal_models.effects.base.findings import Finding, LiveCheck, frames_inside
from glovecal_models.effects.sensor_fault.fault_watch import (
    LONGEST_JUMP_S,
    MOVING_SHARE,
    FaultLimits,
    FaultWatch,
    ReadingTrack,
)
from glovecal_models.progress import Cancel, stop_if
from glovecal_models.takes.reading_faults import smallest_step
from glovecal_models.takes.take import Take

# What sound sensors do, learned from the training takes with their faulty stretches left out.


LASTING = ("jump", "changed", "switching", "hum")
"""Kinds that leave a sound sensor, if another one than before; or that no single frame shows."""
LEAST_OF_RANGE = (0.5, 99.5)
JUMP_LAGS = 8
CHANGE_QUANTILE, CHANGE_MARGIN = 0.9998, 1.3
STILL_MARGIN, LEAST_STILL_S = 1.3, 0.1
MOVE_LAGS_S = (0.017, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2)


def fault_limits(
    takes: Sequence[Take],
    sensors: Sequence[str],
    found: Sequence[Finding],
    reads: Mapping[str, Sequence[str]],
) -> FaultLimits:
    """``reads``: the sensors that each rotation is read from."""
    sound = [_sound(take, sensors, found) for take in takes]
    readings = [take.readings[:, [take.sensors.index(name) for name in sensors]] for take in takes]
    lags = _frame_lags(takes)
    every = np.concatenate(readings)
    span = np.maximum(np.ptp(np.percentile(every, LEAST_OF_RANGE, axis=0), axis=0), 1e-9)
    still = np.array([_longest_still(takes, readings, sound, column) for column in range(len(sensors))])
    surprise = _largest_surprises(takes, readings, sound, lags) / span[:, None]
    # Not every fault of a failing sensor is found, least while its joint rests: sound ones tell more.
    failing = {name for item in found for name in item.where if item.kind not in LASTING}
    fails = np.array([name in failing for name in sensors])
    if not fails.all():
        still = np.where(fails, still[~fails].max(), still)
        surprise = np.where(fails[:, None], surprise[~fails].max(axis=0), surprise)
    return FaultLimits(
        tuple(sensors),
        tuple(float(lag * _interval(takes)) for lag in lags),
        tuple(tuple(map(float, row)) for row in surprise * span[:, None]),
        tuple(float(max(STILL_MARGIN * value, LEAST_STILL_S)) for value in still),
        tuple(reads),
        MOVE_LAGS_S,
        tuple(_moves(takes, name) for name in reads),
        tuple(tuple(names) for names in reads.values()),
    )


def _sound(take: Take, sensors: Sequence[str], found: Sequence[Finding]) -> np.ndarray:
    """(N, S) False in the stretches that were found faulty; a change for good leaves a sound sensor."""
    sound = np.ones((len(take.time_s), len(sensors)), dtype=bool)
    for item in found:
        for name in item.where:
            if name in sensors and item.kind not in LASTING:
                sound[:, list(sensors).index(name)] &= ~frames_inside(take, item.stretches)
    return sound


def _interval(takes: Sequence[Take]) -> float:
    """Seconds between frames; 1 where no take has two."""
    steps = np.concatenate([np.diff(take.time_s) for take in takes])
    return float(np.median(steps)) if len(steps) else 1.0


def _frame_lags(takes: Sequence[Take]) -> list[int]:
    longest = max(2, round(LONGEST_JUMP_S / _interval(takes)))
    return sorted({int(lag) for lag in np.geomspace(1, longest, JUMP_LAGS)})


def _largest_surprises(
    takes: Sequence[Take], readings: Sequence[np.ndarray], sound: Sequence[np.ndarray], lags: Sequence[int]
) -> np.ndarray:
    """(S, K) counts, growing with the lag."""
    found: list[list[np.ndarray]] = [[] for _ in lags]
    for take, part, good in zip(takes, readings, sound, strict=True):
        track, ahead = ReadingTrack(take.time_s[0], part[0]), np.full((len(lags), *part.shape), np.nan)
        for row in range(1, len(part)):
            track.take(take.time_s[row], part[row], good[row])
            for number, lag in enumerate(lags):
                if row + lag < len(part):
                    ahead[number, row + lag] = track.foretold(take.time_s[row + lag])
        for number, lag in enumerate(lags):
            usable = good.copy()
            usable[lag:] &= good[:-lag]
            found[number].append(np.where(usable, np.abs(part - ahead[number]), np.nan))
    steps = [
        max(smallest_step(part[:, column]) for part in readings) for column in range(readings[0].shape[1])
    ]
    largest = []
    for each in found:
        changes = np.concatenate(each)
        # Where no pair of sound frames lies so far apart, nothing is known but the sensor's whole range.
        changes = np.where(
            np.isfinite(changes).any(axis=0), changes, np.ptp(np.concatenate(readings), axis=0)
        )
        largest.append(CHANGE_MARGIN * np.nanquantile(changes, CHANGE_QUANTILE, axis=0))
    return np.maximum.accumulate(np.array(largest) + steps, axis=0).T


def _longest_still(
    takes: Sequence[Take], readings: Sequence[np.ndarray], sound: Sequence[np.ndarray], column: int
) -> float:
    """Seconds in which the others moved, as the watch counts them."""
    longest = 0.0
    for take, part, good in zip(takes, readings, sound, strict=True):
        changed = np.diff(part, axis=0) != 0
        others = changed.sum(axis=1) - changed[:, column] >= max(MOVING_SHARE * (part.shape[1] - 1), 1.0)
        passed = np.where(others, np.diff(take.time_s), 0.0)
        is_still = ~changed[:, column] & good[1:, column]
        total = np.cumsum(np.where(is_still, passed, 0.0))
        before = np.maximum.accumulate(np.where(is_still, 0.0, total))
        longest = max(longest, float(np.max(total - before, initial=0.0)))
    return longest


def _moves(takes: Sequence[Take], rotation: str) -> tuple[float, ...]:
    """RMS change of the reference, degrees, within each of ``MOVE_LAGS_S``."""
    found = []
    for lag_s in MOVE_LAGS_S:
        square, count = 0.0, 0
        for take in takes:
            angle = take.reference_at_frames([rotation])[:, 0]
            lag = max(1, round(lag_s / _interval([take])))
            change = angle[lag:] - angle[:-lag]
            known = np.isfinite(change)
            square, count = square + float(np.sum(change[known] ** 2)), count + int(known.sum())
        found.append(float(np.sqrt(square / max(count, 1))))
    return tuple(found)


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
