"""The internal clock of a CyberGlove III, set and measured by asking it (Krnoul et al. 2016, section 3.1).

``1tg`` tells whole frames of 1/30 s only. Each answer bounds the clock from both sides: when the question
left it had not passed the frame's end, and when the answer came it had reached the frame's beginning. Many
answers at other phases of a frame bound it far below one frame; asking ends when that is so.
"""

from __future__ import annotations

import re
import time
from dataclasses import dataclass
from datetime import datetime

from glovecal_client.capture.cyberglove3.conversation import command, question
from glovecal_client.capture.stream.links import Link
from glovecal_client.clock import wall_ns
from glovecal_client.errors import DeviceLost

WANTED_S = 0.004
"""Half of the interval that the offset lies in: asking goes on until it is that short."""
MOST_S = 3.0
MOST_SETTINGS = 5
DAY_S = 86400.0
_SAID = re.compile(rb"([0-2][0-9]):([0-5][0-9]):([0-5][0-9]):([0-9]{2})")


@dataclass(frozen=True)
class ClockReading:
    """The glove's clock less the computer's wall clock of the day, in seconds."""

    ahead_s: float
    half_width_s: float
    """The offset lies within this of ``ahead_s``, for certain while both clocks drift slowly."""
    polls: int
    wall_s: float
    """When: the computer's wall clock, seconds since 1970."""
    is_consistent: bool
    """False: the answers contradict each other, the clock jumps or counts no frames."""

    @property
    def sd_s(self) -> float:
        """Of an even distribution over the interval."""
        return self.half_width_s / 3**0.5


def read_clock(link: Link, frame_rate: float, wanted_s: float = WANTED_S) -> ClockReading:
    """Ask until the offset is known to ``wanted_s``, three seconds at most. Raises DeviceLost."""
    frame_s, low, high, polls, frames_seen = 1.0 / frame_rate, -DAY_S, DAY_S, 0, set()
    second_low, second_high, consistent = -DAY_S, DAY_S, True
    begun = time.monotonic()
    while True:
        sent_s = wall_of_day_s()  # of an answer to a repeated question the bound is wider, never wrong
        heard = question(link, b"1tg", _SAID)
        got_s = wall_of_day_s()
        found = _SAID.search(heard)
        if found is None:
            raise DeviceLost(f"the glove does not tell its time; heard {heard[:24]!r} after 1tg")
        hour, minute, second, frame = (int(part) for part in found.groups())
        said_s, polls = 3600 * hour + 60 * minute + second, polls + 1
        frames_seen.add(frame)
        at_s = said_s + frame * frame_s
        low, high = max(low, nearest_s(at_s - got_s)), min(high, nearest_s(at_s + frame_s - sent_s))
        second_low = max(second_low, nearest_s(said_s - got_s))
        second_high = min(second_high, nearest_s(said_s + 1 - sent_s))
        is_out = time.monotonic() - begun > MOST_S
        if high < low or (is_out and frames_seen == {0}):
            # frames are not counted, or not as stated: whole seconds are all that can be used
            low, high, consistent = second_low, second_high, second_high >= second_low
            is_out = True
        if is_out or (high - low <= 2 * wanted_s and polls > 1):
            return ClockReading((low + high) / 2, max(0.0, high - low) / 2, polls, time.time(), consistent)
        time.sleep(0.37 * frame_s)


def set_clock(link: Link, frame_rate: float, wanted_s: float | None = None) -> tuple[ClockReading, int]:
    """Set the clock to the computer's, until they differ by less than ``wanted_s`` (a frame); how often.

    Only whole seconds can be set, so the command leaves when a second begins. Raises DeviceLost.
    """
    wanted_s = 1.0 / frame_rate if wanted_s is None else wanted_s
    early_s, reading = 0.0, None
    for times in range(1, MOST_SETTINGS + 1):
        at_s = wall_of_day_s()
        second = int(at_s + 1.05 + early_s)
        time.sleep(max(0.0, second - early_s - wall_of_day_s()))
        second %= int(DAY_S)
        command(link, f"1ts{second // 3600:02}:{second // 60 % 60:02}:{second % 60:02}".encode())
        reading = read_clock(link, frame_rate)
        if abs(reading.ahead_s) <= wanted_s:
            return reading, times
        early_s = min(0.5, max(0.0, early_s - reading.ahead_s))
    assert reading is not None
    return reading, MOST_SETTINGS


def wall_of_day_s() -> float:
    """Seconds since local midnight by the computer's wall clock."""
    now = datetime.fromtimestamp(wall_ns() / 1e9)
    return 3600 * now.hour + 60 * now.minute + now.second + now.microsecond / 1e6


def nearest_s(difference_s: float) -> float:
    """Of two clocks that begin anew each day."""
    return (difference_s + DAY_S / 2) % DAY_S - DAY_S / 2
