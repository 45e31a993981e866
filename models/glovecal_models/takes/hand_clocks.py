"""Two hands' takes on one time: which clock the times of each are of, and how far those are apart.

Three ways lead two gloves, and an optical system, onto one clock: one capture computer, whose clock all
its takes have; a time code (LTC) that each device follows; an event that all of them see, such as a clap.
Krnoul et al. 2016 (section 3.1) set the gloves' own clocks together; here how they stand is measured and kept
with the take (its accounting's ``own_clock``), with the drift that sets them apart again.

An event that two gloves feel at once, such as hands that clap: how far apart their clocks show it.

A clap jolts every sensor within a few frames; free motion does not. Of each take the frames where most
sensors jump out and back are events. The shift under which most of them coincide is refined below one frame
by correlating both takes around each. Several claps at uneven intervals leave one shift; a single one must
be the only event that is near.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.takes.take import Take

STEP_S = 0.0025
JOLT_S = 0.08
"""Around an event: what is compared."""
REACH_S = 0.045
"""A reading is held against those so long before and after it: longer than a jolt, shorter than a motion."""
MOST_BEND_OF_ONE = 20.0
"""Of its usual bend: no single sensor makes an event."""
EVENTS_APART_S = 0.3
"""Of two events of one take."""
FAR_ABOVE = 10.0
"""Median absolute deviations above the median acceleration make an event."""
COINCIDE_S = 0.06
MOST_EVENTS = 60
LEAST_LIKENESS = 0.5
DISAGREE_S = 0.02
"""Shifts of single events that differ by more from their median are left out."""
How = Literal["one computer", "timecode", "claps", "wall clocks", "assumed"]
DAY_S = 86400.0
WALL_SD_S = 0.05
"""Of two computers in one network that set their clocks by NTP; ours to judge, not measured."""
SAME_S = 1e-9


@dataclass(frozen=True)
class CommonEvents:
    """The shift between two takes."""

    shift_s: float
    """Added to the second take's times it puts the events onto those of the first."""
    sd_s: float
    """Standard deviation of ``shift_s``: of the events', else a third of a frame."""
    count: int
    at_s: float
    """Their middle, by the first take's clock."""


def common_events(first: Take, second: Take, most_apart_s: float = 2.0) -> CommonEvents:
    """``most_apart_s``: how far the clocks may be apart. Raises BadInput where none is found, or two are."""
    jolts = [_Jolts.of(take) for take in (first, second)]
    for take, jolt in zip((first, second), jolts, strict=True):
        if not len(jolt.events_s):
            raise BadInput(f"take {take.name!r} shows no clap: clap three times, at uneven intervals")
    pairs = [
        (early, late)
        for early in jolts[0].events_s
        for late in jolts[1].events_s
        if abs(early - late) <= most_apart_s
    ]
    if not pairs:
        raise BadInput(
            f"no clap of {first.name!r} is within {most_apart_s:g} s of one of {second.name!r}: were both "
            "recorded at one time?"
        )
    shifts = np.array([early - late for early, late in pairs])
    votes = (np.abs(shifts[:, None] - shifts[None, :]) <= COINCIDE_S).sum(axis=1)
    best = shifts[np.argmax(votes)]
    rivals = votes[np.abs(shifts - best) > 2 * COINCIDE_S]
    if len(rivals) and rivals.max() >= votes.max():
        other = shifts[np.abs(shifts - best) > 2 * COINCIDE_S][np.argmax(rivals)]
        raise BadInput(
            f"the claps of {first.name!r} and {second.name!r} fit in more than one way, {best:+.2f} s and "
            f"{other:+.2f} s: clap three times, at "
            "uneven intervals"
        )
    refined = [
        (early, found)
        for early, late in pairs
        if abs(early - late - best) <= COINCIDE_S
        and (found := _refined(jolts[0], jolts[1], early, late)) is not None
    ]
    if not refined:
        raise BadInput(f"the claps of {first.name!r} and {second.name!r} do not look alike; clap again")
    found = np.array([shift for _, shift in refined])
    kept = np.abs(found - np.median(found)) <= DISAGREE_S
    frame_s = max(jolts[0].frame_s, jolts[1].frame_s)
    spread = float(found[kept].std(ddof=1)) if kept.sum() > 1 else frame_s / 3
    at_s = float(np.mean([early for (early, _), keep in zip(refined, kept, strict=True) if keep]))
    sd_s = max(spread, frame_s / 10) / float(np.sqrt(kept.sum()))
    return CommonEvents(float(found[kept].mean()), sd_s, int(kept.sum()), at_s)


@dataclass(frozen=True)
class _Jolts:
    """How far all sensors jump out and back, 1 on average, on a grid of ``STEP_S``."""

    begin_s: float
    signal: np.ndarray
    events_s: np.ndarray
    frame_s: float

    @classmethod
    def of(cls, take: Take) -> _Jolts:
        time_s, readings = take.time_s, take.readings
        frame_s = float(np.median(np.diff(time_s))) if len(time_s) > 1 else 1.0
        reach = max(1, round(REACH_S / frame_s))
        if len(time_s) < 4 * reach:
            return cls(float(time_s[0]), np.ones(1), np.empty(0), frame_s)
        bend = np.abs(readings[reach:-reach] - (readings[2 * reach :] + readings[: -2 * reach]) / 2)
        alive = np.ptp(readings, axis=0) > 0
        scale = np.maximum(bend[:, alive].mean(axis=0), 1e-9)
        jolt = np.minimum(bend[:, alive] / scale, MOST_BEND_OF_ONE).mean(axis=1)
        middle_s = time_s[reach:-reach]
        grid = np.arange(middle_s[0], middle_s[-1], STEP_S)
        signal = np.interp(grid, middle_s, jolt)
        return cls(float(grid[0]), signal, _events(middle_s, jolt), frame_s)

    def around(self, at_s: float, half_s: float) -> np.ndarray | None:
        """The signal within ``half_s``, centred; None at the take's ends."""
        middle, half = round((at_s - self.begin_s) / STEP_S), round(half_s / STEP_S)
        if middle - half < 0 or middle + half >= len(self.signal):
            return None
        return self.signal[middle - half : middle + half + 1]


def _events(time_s: np.ndarray, jolt: np.ndarray) -> np.ndarray:
    """Times of the peaks far above what is usual, ``EVENTS_APART_S`` apart, the largest first kept."""
    usual = float(np.median(jolt))
    deviation = max(1.4826 * float(np.median(np.abs(jolt - usual))), 1e-9)
    events: list[float] = []
    for place in np.argsort(jolt)[::-1]:
        if jolt[place] < usual + FAR_ABOVE * deviation or len(events) >= MOST_EVENTS:
            break
        if all(abs(time_s[place] - other) > EVENTS_APART_S for other in events):
            events.append(float(time_s[place]))
    return np.sort(np.array(events))


def _refined(first: _Jolts, second: _Jolts, early: float, late: float) -> float | None:
    """The shift under which both signals around an event agree best; None where they do not."""
    pattern, longer = first.around(early, JOLT_S), second.around(late, JOLT_S + COINCIDE_S)
    if pattern is None or longer is None:
        return None
    pattern = pattern - pattern.mean()
    places = len(longer) - len(pattern) + 1
    score = np.empty(places)
    for place in range(places):
        piece = longer[place : place + len(pattern)]
        piece = piece - piece.mean()
        score[place] = pattern @ piece / max(float(np.linalg.norm(pattern) * np.linalg.norm(piece)), 1e-12)
    best = int(np.argmax(score))
    if score[best] < LEAST_LIKENESS or not 0 < best < places - 1:
        return None
    before, at, after = score[best - 1 : best + 2]
    part = 0.5 * (before - after) / min(before - 2 * at + after, -1e-12)
    return early - (late + (best + part - (places - 1) / 2) * STEP_S)


@dataclass(frozen=True)
class TakeClock:
    """What is known of the clock of one take's ``time_s``."""

    computer: str | None = None
    """Whose monotonic clock it is; None: nobody said, as in an imported table."""
    wall_minus_time_s: float | None = None
    own: Mapping[str, Any] | None = None
    """The glove's own clock against it, as ``own_clock`` of the capture daemon's status."""

    @classmethod
    def of_accounting(cls, accounting: Mapping[str, Any] | None) -> TakeClock:
        """From what the recorder keeps with a take; None for an imported one."""
        facts = accounting or {}
        own = facts.get("own_clock")
        return cls(
            facts.get("computer"), facts.get("wall_minus_time_s"), own if isinstance(own, Mapping) else None
        )

    @property
    def has_timecode(self) -> bool:
        return self.own is not None and self.own.get("kind") == "ltc"

    @property
    def drift(self) -> float:
        """What the glove's own clock gains against the take's, s per s; 0 where it is not known."""
        return 0.0 if self.own is None else 1e-6 * float(self.own["drift_ppm"])

    def own_s(self, time_s: float) -> float:
        """The glove's own clock at a time of the take."""
        assert self.own is not None
        return float(self.own["own_s"]) + (1 + self.drift) * (time_s - float(self.own["at_monotonic_s"]))


@dataclass(frozen=True)
class HandAlignment:
    """``time of the first = at_s + shift_s + (1 + drift) * (time of the second - at_s)``."""

    how: How
    shift_s: float
    """Added to the second take's time at ``at_s``."""
    drift: float
    at_s: float
    """The middle of the second take."""
    sd_s: float
    """Standard deviation of the shift, with the jitter of both takes' frames."""

    def onto_first(self, time_s: np.ndarray) -> np.ndarray:
        """Times of the second take on the first one's clock."""
        return time_s + self.shift_s + self.drift * (time_s - self.at_s)


def align(
    first: Take, second: Take, clocks: tuple[TakeClock, TakeClock], *, claps: bool = False
) -> HandAlignment:
    """By one computer, else by time code, else by both computers' wall clocks; with ``claps`` by those alone.

    Raises BadInput where claps are asked for and do not tell.
    """
    at_s = float(second.time_s[0] + second.time_s[-1]) / 2
    jitter_s = float(np.hypot(frame_jitter_s(first), frame_jitter_s(second)))
    if claps:
        found = common_events(first, second)
        return HandAlignment("claps", found.shift_s, 0.0, at_s, found.sd_s)
    one, other = clocks
    if one.computer is not None and one.computer == other.computer:
        return HandAlignment("one computer", 0.0, 0.0, at_s, jitter_s)
    if one.has_timecode and other.has_timecode:
        return _by_timecode(one, other, at_s, jitter_s)
    if one.wall_minus_time_s is not None and other.wall_minus_time_s is not None:
        shift = other.wall_minus_time_s - one.wall_minus_time_s
        return HandAlignment("wall clocks", shift, 0.0, at_s, float(np.hypot(WALL_SD_S, jitter_s)))
    return HandAlignment("assumed", 0.0, 0.0, at_s, float("nan"))


def frame_jitter_s(take: Take) -> float:
    """How far single frames' times lie off their rhythm, standard deviation; gaps do not count."""
    steps = np.diff(take.time_s)
    if len(steps) < 8:
        return 0.0
    usual = float(np.median(steps))
    return float(np.std(steps[steps < 3 * usual]) / np.sqrt(2))


def _by_timecode(one: TakeClock, other: TakeClock, at_s: float, jitter_s: float) -> HandAlignment:
    """Both gloves stamp one time code: the first take's time at which its code is the second's."""
    assert one.own is not None
    assert other.own is not None
    said = other.own_s(at_s)
    since = (said - float(one.own["own_s"]) + DAY_S / 2) % DAY_S - DAY_S / 2
    first_s = float(one.own["at_monotonic_s"]) + since / (1 + one.drift)
    drift = (1 + other.drift) / (1 + one.drift) - 1
    sd_s = float(np.linalg.norm([float(one.own["sd_s"]), float(other.own["sd_s"]), jitter_s]))
    return HandAlignment("timecode", first_s - at_s, drift, at_s, sd_s)
