"""Two hands' takes on one time: which clock the times of each are of, and how far those are apart.

Three ways lead two gloves, and an optical system, onto one clock: one capture computer, whose clock all
its takes have; a time code (LTC) that each device follows; an event that all of them see, such as a clap.
Krnoul et al. 2016 (section 3.1) set the gloves' own clocks together; here how they stand is measured and kept
with the take (its accounting's ``own_clock``), with the drift that sets them apart again.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from glovecal_models.takes.common_event import common_events
from glovecal_models.takes.take import Take

How = Literal["one computer", "timecode", "claps", "wall clocks", "assumed"]
DAY_S = 86400.0
WALL_SD_S = 0.05
"""Of two computers in one network that set their clocks by NTP; ours to judge, not measured."""
SAME_S = 1e-9


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
