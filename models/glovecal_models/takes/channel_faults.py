"""Faults of channels that readings show by themselves: a flat line in the middle of motion, clipping, a
channel that is dead, two that read the same, and two that are exchanged from a moment on.

A finger at rest reads one value for seconds on a coarse and quiet glove, so that a flat line tells nothing
there. Where a channel goes to and fro by itself even while it hardly moves, or has so many steps that a hand
at rest crosses some, it is never still; then a flat line while most others move was not made by the finger.
Two channels that a finger moves alike differ by what moves as it does; a copy differs by noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
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
CLIPPED_AT_MOST = 0.5
"""Share of the frames of a take in one flat line: a longer one is no end of a movement."""
OTHERS_MOVE = 0.5
"""Share of the other channels that change in most of the frames meanwhile."""
SAME_SHARE, STEPS_WIDE = 0.99, 30
"""Of the frames in which two channels lie within a step of each other, over a range of so many."""
COPY_SHARE, COPY_FOLLOWS, COPY_SHAKES = 0.02, 0.3, 0.3
"""Of the range, by which the difference from a copy spreads; how far that goes along with itself a frame
later, or with the channel; and the least correlation of what no movement is so quick to make: sensors that
one bend moves alike have each its own."""
EXCHANGE_TIMES, EXCHANGE_SHARE = 2.0, 0.25
"""Both channels step by so many times all else that they do within a frame, each to within so much of that of
where the other was."""
PAUSE_FRAMES, SLOWEST_S = 3.0, 0.1
"""After a longer pause, and with frames further apart, a channel may be anywhere."""
LIVES_SHARE, LEAST_MOVED_DEG = 0.3, 10.0
"""Of its range over all takes: a channel goes through so much in a take in which the hand moves; and the
joint."""


@dataclass(frozen=True)
class ChannelFault:
    """``what`` goes on after the channels' names; ``remedy`` is a sentence."""

    channels: tuple[str, ...]
    what: str
    remedy: str

    def __str__(self) -> str:
        return f"{' and '.join(self.channels)} {self.what}"


def session_faults(
    takes: Sequence[Take], sensors: Sequence[str] | None = None
) -> tuple[tuple[Take, ChannelFault], ...]:
    """Each take with what it shows of those of ``sensors`` (None: any) that all takes have."""
    takes = [take for take in takes if len(take.time_s) > 1]
    shared = set[str]() if not takes else set.intersection(*(set(take.sensors) for take in takes))
    names = tuple(name for name in sensors or (takes[0].sensors if takes else ()) if name in shared)
    if not names:
        return ()
    takes = [_with_sensors(take, names) for take in takes]
    low = np.min([take.readings.min(axis=0) for take in takes], axis=0)
    high = np.max([take.readings.max(axis=0) for take in takes], axis=0)
    faults = []
    for take in takes:
        dead = _dead(take, takes, high - low)
        faults += [(take, fault) for fault in dead]
        gone = {name for fault in dead for name in fault.channels}
        faults += [
            (take, fault)
            for fault in channel_faults(take, (low, high))
            if not gone.intersection(fault.channels)
        ]
    return tuple(faults)


def _with_sensors(take: Take, names: tuple[str, ...]) -> Take:
    if take.sensors == names:
        return take
    order = [take.sensors.index(name) for name in names]
    return replace(take, sensors=names, readings=take.readings[:, order])


def _dead(take: Take, takes: Sequence[Take], ranges: np.ndarray) -> list[ChannelFault]:
    """Channels that stand at one value, or between two, while the hand moves."""
    low, high = take.readings.min(axis=0), take.readings.max(axis=0)
    two = ((take.readings == low) | (take.readings == high)).all(axis=0)
    if not two.any() or len(take.time_s) < STUCK_FRAMES:
        return []
    lives = (high - low >= LIVES_SHARE * ranges) & ~two
    faults = []
    for index in np.flatnonzero(two):
        name = take.sensors[index]
        has_lived = ranges[index] > high[index] - low[index]
        # Of a joint that was not measured, only what moved elsewhere is known to be able to.
        measured = [name] if name in take.rotations else list(take.rotations)
        angles = take.reference[:, [take.rotations.index(each) for each in measured]]
        moved = any(_moved(column) >= LEAST_MOVED_DEG for column in angles.T)
        others = np.delete(lives, index)
        never_still = has_lived and _is_never_still(takes, name)
        if (
            others.any()
            and others.mean() >= OTHERS_MOVE
            and (moved if name in take.rotations or not has_lived else never_still)
        ):
            level = f"{low[index]:g}" if low[index] == high[index] else f"{low[index]:g} or {high[index]:g}"
            faults.append(
                ChannelFault((name,), f"is dead: always {level} while others move", "Is its wire broken?")
            )
    return faults


def _moved(angles: np.ndarray) -> float:
    known = angles[np.isfinite(angles)]
    return float(np.ptp(known)) if len(known) else 0.0


def _is_never_still(takes: Sequence[Take], name: str) -> bool:
    columns = [take.readings[:, take.sensors.index(name)] for take in takes]
    return any(_moves_always(column, smallest_step(column)) for column in columns)


def _moves_always(values: np.ndarray, step: float) -> bool:
    return step > 0 and (bool(np.ptp(values) >= FINE_COUNTS * step) or _is_restless(values))


def channel_faults(take: Take, ends: tuple[np.ndarray, np.ndarray] | None = None) -> tuple[ChannelFault, ...]:
    """In the order of the channels; frames must be in order of time. ``ends`` (S,) of each channel's range;
    None: the take's own."""
    time_s, readings, names = take.time_s, take.readings, take.sensors
    low, high = (readings.min(axis=0), readings.max(axis=0)) if ends is None else ends
    faults: list[ChannelFault] = []
    changes = np.diff(readings, axis=0, prepend=np.nan) != 0
    for index, name in enumerate(names):
        values = readings[:, index]
        step = smallest_step(values)
        if np.ptp(values) < 1.5 * step or not _moves_always(values, step):
            continue
        others = np.delete(changes, index, axis=1)
        faults += _flat_lines(time_s, values, others, name, (low[index], high[index]))
    return (*faults, *_same(readings, names), *_exchanged(time_s, readings, names))


def _flat_lines(
    time_s: np.ndarray, values: np.ndarray, others: np.ndarray, name: str, ends: tuple[float, float]
) -> list[ChannelFault]:
    start, end = constant_runs(values)
    if not len(start) or not others.shape[1]:
        return []
    length = end - start
    at_end = (values[start] == ends[0]) | (values[start] == ends[1])
    at_end &= length < CLIPPED_AT_MOST * len(values)
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
        apart = readings[:, one] - readings[:, other]
        is_within = (np.abs(apart) <= min(steps[one], steps[other])).mean() >= SAME_SHARE
        if is_within or _is_copy(readings[:, one], apart):
            both = names[one], names[other]
            found.append(ChannelFault(both, "read the same", "Is one wired to the other, or counted twice?"))
    return found


def _is_copy(values: np.ndarray, apart: np.ndarray) -> bool:
    """Whether (N,) differences from a channel are its copy's noise."""
    if np.sqrt(np.mean(apart**2)) > COPY_SHARE * np.ptp(values) or len(apart) < STUCK_FRAMES:
        return False
    away, own = apart - apart.mean(), values - values.mean()
    whole = float(away @ away)
    if whole == 0:
        return True
    later = float(away[1:] @ away[:-1]) / whole
    along = float(away @ own) / np.sqrt(whole * float(own @ own))
    if max(abs(later), abs(along)) > COPY_FOLLOWS:
        return False
    one, other = np.diff(values, 3), np.diff(values - apart, 3)
    both = np.sqrt(float(one @ one) * float(other @ other))
    return both > 0 and float(one @ other) >= COPY_SHAKES * both


def _exchanged(time_s: np.ndarray, readings: np.ndarray, names: Sequence[str]) -> list[ChannelFault]:
    """Pairs that go on where the other one was, each within one frame."""
    if len(time_s) < STUCK_FRAMES:
        return []
    steps = np.abs(np.diff(readings, axis=0))
    at = steps.argmax(axis=0)
    rest = steps.copy()
    rest[at, np.arange(len(names))] = 0.0
    height, usual = steps.max(axis=0), rest.max(axis=0)
    pause = PAUSE_FRAMES * float(np.median(np.diff(time_s)))
    faults = []
    for one, other in combinations(range(len(names)), 2):
        row = int(at[one])
        pair = [one, other]
        if at[other] != row or time_s[row + 1] - time_s[row] > min(pause, SLOWEST_S):
            continue
        if (height[pair] <= EXCHANGE_TIMES * usual[pair]).any():
            continue
        missed = np.abs(readings[row + 1, pair] - readings[row, pair[::-1]])
        if (missed <= EXCHANGE_SHARE * height[pair]).all():
            both = names[one], names[other]
            what = f"exchange their readings at {time_s[row + 1]:.2f} s"
            faults.append(
                ChannelFault(both, what, "Was a plug moved? Leave out what follows, or record again.")
            )
    return faults
