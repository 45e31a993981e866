"""What a few seconds of a worn glove say: is it a sensor, the cable, the supply, the wearing?

No reference is needed. A stuck sensor only shows while the hand moves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.calibration.samples import trained_ranges
from glovecal_models.calibration.servable import Misfit, WearerFit
from glovecal_models.takes.channel_faults import channel_faults
from glovecal_models.takes.reading_faults import dropouts, spikes
from glovecal_models.takes.take import Take
from glovecal_models.takes.take_check import check_take, dead_sensors

Part = Literal["capture", "cable", "sensor", "supply", "motion", "wearing", "wearer", "model"]

SLOW_SHARE = 0.8
"""Of the nominal rate: fewer frames a second are too few."""
FEW_GAPS = 2
"""In some seconds: a busy computer has as many."""
MOVED_COUNTS = 6.0
"""A sensor that went through fewer counts did not move."""
MOVED_SHARE = 0.08
"""Of the range learned: a sensor that went through less did not move."""
FEW_MOVED = 0.5
"""Share of sensors: with fewer in motion nothing is said of those that stand still."""
FEW_JUMPS = 3
"""In some seconds: from so many on a sensor jumps."""
OUTSIDE_SHARE = 0.1
"""Of the range learned, beyond its ends."""
OUTSIDE_FRAMES = 0.25
"""Share of the frames that must lie there."""
ALL_AT_ONCE = 0.6
"""Share of sensors beyond the same end: what they have in common is the supply."""
FEWEST_TOGETHER = 3
"""Sensors; fewer have nothing in common."""
MOSTLY = 0.8
"""Share of the frames at one value, from which on a sensor is looked at more closely."""
RESTING_VALUES = 2
"""Between so many a joint at rest trembles too: in some seconds they do not tell a sensor from its joint."""
MOST_NAMED = 4


@dataclass(frozen=True)
class GloveFinding:
    """One thing that is wrong, and what to do."""

    part: Part
    sentence: str
    advice: str


def worn_glove_findings(
    take: Take, nominal_hz: float | None, model: CalibrationModel | None
) -> tuple[GloveFinding, ...]:
    """Of some seconds of frames, the hand in motion; ``model``: the one that is served, None without any."""
    low, high = _ranges(take, model)
    fit = _fit(take, model)
    moved = np.ptp(take.readings, axis=0) >= np.fmax(MOVED_COUNTS, MOVED_SHARE * np.nan_to_num(high - low))
    jumps = _jumps(take, low, high)
    return (
        *_rhythm(take, nominal_hz),
        *_sensors(take, moved),
        *(GloveFinding("sensor", f"{each}.", each.remedy) for each in channel_faults(take)),
        *jumps,
        *((not jumps and _wearer(take, fit)) or _place(take, fit)),
    )


def live_findings(
    readings: np.ndarray, sensors: Sequence[str], fit: WearerFit | None, degrees: np.ndarray
) -> tuple[GloveFinding, ...] | None:
    """Of the last seconds of a glove that is used: ``readings`` (N, S), angles (N, R) by the served model.

    Frames need not be in order. None while the hand does not move: then nothing can be said.
    """
    low, high = (np.full(len(sensors), np.nan),) * 2 if fit is None else (fit.low, fit.high)
    travelled = np.ptp(readings, axis=0)
    moved = travelled >= np.fmax(MOVED_COUNTS, MOVED_SHARE * np.nan_to_num(high - low))
    if moved.mean() < FEW_MOVED:
        return None
    at_an_end = [
        (readings == end).mean(axis=0) > MOSTLY for end in (readings.min(axis=0), readings.max(axis=0))
    ]
    suspect = (travelled <= 1.0) | at_an_end[0] | at_an_end[1]
    found: list[GloveFinding] = []
    if suspect.any():  # what takes a millisecond is done only then
        take = Take("now", "", tuple(sensors), np.arange(float(len(readings))), readings)
        found += _sensors(take, moved)
    if fit is not None:
        found += _misfit(fit.misfit(readings, degrees))
    return tuple(found)


@dataclass(frozen=True)
class _Fit:
    """What a model learned, and how its sensors stand in a take."""

    wearer: WearerFit
    predictor: GlovePredictor
    columns: Sequence[int]


def _fit(take: Take, model: CalibrationModel | None) -> _Fit | None:
    if model is None or not set(model.layout.sensors) <= set(take.sensors):
        return None
    predictor = GlovePredictor(model)
    columns = [take.sensors.index(name) for name in model.layout.sensors]
    return _Fit(WearerFit(model, predictor), predictor, columns)


def _wearer(take: Take, fit: _Fit | None) -> Sequence[GloveFinding]:
    """Whether the model is that of somebody else; nothing where the supply explains the readings."""
    if fit is None or any(finding.part == "supply" for finding in _place(take, fit)):
        return ()
    readings = take.readings[:, fit.columns]
    return _misfit(fit.wearer.misfit(readings, fit.predictor.predict(readings).mean))


def _misfit(found: Misfit) -> Sequence[GloveFinding]:
    if not found.is_clear:
        return ()
    beyond = [(found.rotations, "reach angles no hand reaches"), (found.sensors, "go beyond what it learned")]
    named = "; ".join(f"{', '.join(names[:MOST_NAMED])} {how}" for names, how in beyond if names)
    who = "it may be a glove of the other hand" if found.is_sideways else "it may be another person's model"
    return (
        GloveFinding(
            "wearer",
            f"The readings do not fit the model ({named}): {who}.",
            "Check who wears it and on which hand; if that is right, put it on again and do a quick check.",
        ),
    )


def _ranges(take: Take, model: CalibrationModel | None) -> tuple[np.ndarray, np.ndarray]:
    if model is None:
        nothing = np.full(len(take.sensors), np.nan)
        return nothing, nothing
    return trained_ranges(model.rotations, take.sensors)


def _rhythm(take: Take, nominal_hz: float | None) -> Sequence[GloveFinding]:
    check = check_take(take)
    count, length = len(take.time_s), float(take.time_s[-1] - take.time_s[0])
    rate = (count - 1) / length if length > 0 else 0.0
    is_slow = nominal_hz is not None and rate < SLOW_SHARE * nominal_hz
    if not is_slow and check.gaps <= FEW_GAPS:
        return ()
    of = "" if nominal_hz is None else f" of {nominal_hz:.0f}"
    longest = (
        f", the longest {check.longest_interval_s:.2f} s" if check.gaps and check.longest_interval_s else ""
    )
    return (
        GloveFinding(
            "cable",
            f"{rate:.0f}{of} frames a second arrive, with {check.gaps} gaps{longest}.",
            "Plug the glove in directly, without a hub; charge it; bring the receiver nearer.",
        ),
    )


def _sensors(take: Take, moved: np.ndarray) -> Sequence[GloveFinding]:
    if moved.mean() < FEW_MOVED:
        return (
            GloveFinding(
                "motion",
                f"{int(moved.sum())} of {len(moved)} sensors moved: nothing can be said of the others.",
                "Run it again while you bend, spread and turn the whole hand.",
            ),
        )
    return [
        GloveFinding(
            "sensor",
            f"{dead.sensor} is {dead.why} while other sensors move.",
            "Look at its strip and its connector; until it is repaired, train without it (it is left out).",
        )
        for dead in dead_sensors([take], take.sensors)
        if len(np.unique(take.readings[:, take.sensors.index(dead.sensor)])) != RESTING_VALUES
    ]


def _jumps(take: Take, low: np.ndarray, high: np.ndarray) -> Sequence[GloveFinding]:
    found = []
    unknown = np.full(len(take.time_s), np.nan)
    for name, readings, begin, end in zip(take.sensors, take.readings.T, low, high, strict=True):
        span = float(end - begin) if np.isfinite(end - begin) and end > begin else float(np.ptp(readings))
        faults = spikes(take.time_s, readings, span, unknown) | dropouts(take.time_s, readings, span, unknown)
        jumps = int((np.diff(faults.astype(int)) > 0).sum())
        if jumps >= FEW_JUMPS:
            found.append((name, jumps))
    if not found:
        return ()
    names = ", ".join(f"{name} ({jumps})" for name, jumps in found)
    if len(found) >= max(FEWEST_TOGETHER, ALL_AT_ONCE * len(take.sensors)):
        return (
            GloveFinding(
                "cable", f"Most sensors jump for single frames: {names}.",
                "They share the cable and the connector at the cuff: press it home, or exchange the cable.",
            ),
        )  # fmt: skip
    return (
        GloveFinding(
            "sensor", f"Readings jump for single frames: {names}.",
            "A loose contact of the strip: bend the cuff a little and see whether it changes.",
        ),
    )  # fmt: skip


def _place(take: Take, fit: _Fit | None) -> Sequence[GloveFinding]:
    """Readings beyond all that the model's hand can do: of most sensors on one side, or of a few."""
    if fit is None:
        return ()
    wearer, readings = fit.wearer, take.readings[:, fit.columns]
    known = np.isfinite(wearer.least) & np.isfinite(wearer.most)
    if not known.any():
        return ()
    margin = OUTSIDE_SHARE * np.where(known, wearer.high - wearer.low, 1.0)
    below = known & ((readings < wearer.least - margin).mean(axis=0) > OUTSIDE_FRAMES)
    above = known & ((readings > wearer.most + margin).mean(axis=0) > OUTSIDE_FRAMES)
    together = max(FEWEST_TOGETHER, ALL_AT_ONCE * known.sum())
    for outside, word in ((below, "below"), (above, "above")):
        if outside.sum() >= together:
            return (
                GloveFinding(
                    "supply",
                    f"{int(outside.sum())} of {int(known.sum())} sensors read {word} all that this hand can"
                    " do.",
                    "That is no hand: check battery and supply, and that this is the glove of the model.",
                ),
            )
    names = [name for name, is_out in zip(wearer.sensors, below | above, strict=True) if is_out]
    if not names:
        return ()
    return (
        GloveFinding(
            "wearing",
            f"{', '.join(names)} read outside what this hand can do.",
            "The glove sits differently: put it on again, or let a quick check learn the difference.",
        ),
    )
