"""Faults of channels that one take shows by itself: a flat line in the middle of motion, clipping, and two
channels that read the same.

A finger at rest reads one value for seconds on a coarse and quiet glove, so that a flat line tells nothing
there. Where a channel goes to and fro by itself even while it hardly moves, or has so many steps that a hand
at rest crosses some, it is never still; then a flat line while most others move was not made by the finger.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from glovecal_models.takes.reading_faults import STUCK_FRAMES, STUCK_S, constant_runs, smallest_step
from glovecal_models.takes.take import Take

FINE_COUNTS = 1000
"""From so many steps over its range on a hand at rest trembles by more than one."""
RESTLESS_SHARE = 0.25
"""Of the frames of its slowest parts in which a channel turns back."""
SLOW_FRAMES, SLOWEST_SHARE = 9, 0.25
"""Frames of a part, and the share of all parts that count as slow."""
TIMES_LONGER = 4.0
"""A flat line, than anything else that the channel repeats: readings may be held for a few frames."""
CLIPPED_FRAMES, CLIPPED_SHARE, CLIPPED_S = 5, 0.04, 0.2
"""Frames in a row at one end of the range, and their share of all frames and seconds together."""
OTHERS_MOVE = 0.5
"""Share of the other channels that change in most of the frames meanwhile."""
SAME_SHARE, STEPS_WIDE = 0.99, 30
"""Of the frames in which two channels lie within a step of each other, over a range of so many."""


@dataclass(frozen=True)
class ChannelFault:
    """``what`` goes on after the channels' names; ``remedy`` is a sentence."""

    channels: tuple[str, ...]
    what: str
    remedy: str

    def __str__(self) -> str:
        return f"{' and '.join(self.channels)} {self.what}"


def channel_faults(take: Take) -> tuple[ChannelFault, ...]:
    """In the order of the channels; frames must be in order of time."""
    time_s, readings, names = take.time_s, take.readings, take.sensors
    faults: list[ChannelFault] = []
    changes = np.diff(readings, axis=0, prepend=np.nan) != 0
    for index, name in enumerate(names):
        values = readings[:, index]
        step = smallest_step(values)
        if step == 0 or not (np.ptp(values) >= FINE_COUNTS * step or _is_restless(values)):
            continue
        others = np.delete(changes, index, axis=1)
        faults += _flat_lines(time_s, values, others, name)
    return (*faults, *_same(readings, names))


def _flat_lines(time_s: np.ndarray, values: np.ndarray, others: np.ndarray, name: str) -> list[ChannelFault]:
    start, end = constant_runs(values)
    if not len(start) or not others.shape[1]:
        return []
    length = end - start
    at_end = (values[start] == values.min()) | (values[start] == values.max())
    lasts = (length >= STUCK_FRAMES) & (time_s[end - 1] - time_s[start] >= STUCK_S) & ~at_end
    usual = int(length[~lasts & ~at_end].max(initial=1))
    odd = (length >= TIMES_LONGER * usual) & (lasts | (at_end & (length >= CLIPPED_FRAMES)))
    for run in np.flatnonzero(odd):
        odd[run] = _others_move(others[start[run] : end[run]])
    faults = []
    stuck, clipped = odd & lasts, odd & at_end
    if stuck.any():
        first = int(np.flatnonzero(stuck)[0])
        begin, until, level = time_s[start[first]], time_s[end[first] - 1], values[start[first]]
        more = int(stuck.sum()) - 1
        again = f", and {more} times more" if more else ""
        faults.append(
            ChannelFault(
                (name,),
                f"reads {level:g} from {begin:.2f} to {until:.2f} s{again} while others move",
                "Look at its wire and plug, and leave that part out or record it again.",
            )
        )  # fmt: skip
    share = float(length[clipped].sum()) / len(values)
    lasted_s = float((time_s[end[clipped] - 1] - time_s[start[clipped]]).sum())
    if share >= CLIPPED_SHARE and lasted_s >= CLIPPED_S:
        level = values[start[np.flatnonzero(clipped)[0]]]
        faults.append(
            ChannelFault(
                (name,),
                f"is cut off at {level:g}, in {100 * share:.0f} % of the frames, while others move",
                "The range of what reads it ends there: set its gain or offset, or train without it.",
            )
        )  # fmt: skip
    return faults


def _is_restless(values: np.ndarray) -> bool:
    """Whether it goes to and fro even where it moves least; flat parts, which are judged by it, left out."""
    if len(values) < 4 * SLOW_FRAMES:
        return False
    parts = np.lib.stride_tricks.sliding_window_view(values, SLOW_FRAMES)
    ranges = np.ptp(parts, axis=1)
    parts, ranges = parts[ranges > 0], ranges[ranges > 0]
    if not len(parts):
        return False
    slow = np.diff(parts[ranges <= np.quantile(ranges, SLOWEST_SHARE)], axis=1)
    return bool((slow[:, 1:] * slow[:, :-1] < 0).mean() >= RESTLESS_SHARE)


def _others_move(changes: np.ndarray) -> bool:
    """(K, S - 1) whether each of the other channels changes from frame to frame."""
    return bool((changes.mean(axis=0) > OTHERS_MOVE).mean() >= OTHERS_MOVE)


def _same(readings: np.ndarray, names: Sequence[str]) -> list[ChannelFault]:
    """Compared by twos; the rounding of one channel may differ from the other's by a step."""
    steps = [smallest_step(column) for column in readings.T]
    moving = [
        index for index, step in enumerate(steps) if step and np.ptp(readings[:, index]) > STEPS_WIDE * step
    ]
    found = []
    for one, other in combinations(moving, 2):
        apart = np.abs(readings[:, one] - readings[:, other])
        if (apart <= min(steps[one], steps[other])).mean() >= SAME_SHARE:
            both = names[one], names[other]
            found.append(ChannelFault(both, "read the same", "Is one wired to the other, or counted twice?"))
    return found
