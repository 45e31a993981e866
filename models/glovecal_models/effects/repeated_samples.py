"""Repeated samples: a recorder that missed a frame wrote the one before again.

A hand at rest repeats 8-bit frames too. Padding shows inside a movement: a sensor goes on in the same
direction right before and right after a frame (or a run of frames) in which nothing at all has changed. The
same is looked for in the rows of the reference, whose padding is usual when it is slower than its file.

A stream that halts now and then repeats too few frames for that. But when it goes on it leaps over what
it missed, and then moves more slowly; a hand that rested starts slowly. How often movements leap by chance is
told by the frames that follow one another without a repeat.

Sensors that are read in turn repeat each by itself: most frames in a movement of theirs hold an old reading.
A buffer that is played again repeats runs of frames (``replayed``).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import bdtrc

from glovecal_models.effects.base.effect import RepairEffect
from glovecal_models.effects.base.facts import About
from glovecal_models.effects.base.findings import Finding, check_signature_input, named
from glovecal_models.effects.base.signals import Settings
from glovecal_models.takes.reading_faults import replayed, smallest_step
from glovecal_models.takes.take import Take

LEAST_REPEATED_SHARE = 0.02
"""Of the moments inside a movement."""
LEAST_COUNT = 10
RARELY_REPEATED_SHARE, RARE_BY_CHANCE, BRIEF_FRAMES = 0.005, 0.001, 10
"""And of those moments by repeats no longer than so, where columns so seldom repeat together by chance: fine
steps of several sensors. Chosen on one simulated glove of 12 bits (1 percent); of 80 healthy gloves none is
named."""
BEYOND_CHANCE = 1.5
"""Columns must repeat together so many times more often than each for itself makes likely."""
FINE_SHARE = 0.5
"""Distinct values of a single column, by rows, above which it does not repeat by coarse steps."""
CLEAR_STEP = 2.0
"""A sensor moves for certain when it steps by so many quanta in one frame."""
NEAR_FRAMES = 5
"""A repeat is dropped when something moves clearly within so many frames; a hand at rest keeps its own."""
LEAP_RATIO = 1.5
"""A leap is so many times longer than the steps before and after it, summed over columns."""
LEAP_STEP = 4.0
"""And some column makes so many quanta in it: slow movements of coarse sensors step unevenly."""
LONGEST_HALT = 60
"""Frames; a hand may rest for longer."""
LEAST_LEAPS = 8
OLD_SHARE, FEWEST_MOMENTS = 0.6, 100
"""A sensor that is read in turn repeats at so many of the moments inside its movements; of sound sensors of 8
to 12 bits, simulated at 30 to 100 Hz, at a quarter at most."""
LEAPS_P_VALUE = 1e-4
"""That so many repeats end in a leap by chance (binomial)."""


@dataclass(frozen=True)
class Repeats:
    """The repeats among N rows."""

    rows: np.ndarray
    """(N,) True for a row that repeats the one before it and stands in or near a movement."""
    interrupted: int
    """Repeats in the middle of a movement that goes on afterwards."""
    moving: int
    """Steps in the middle of a movement, for comparison."""
    together: float = 0.0
    """Share of the rows in or near a movement in which all columns repeat."""
    by_chance: float = 0.0
    """What that share would be if each column repeated for itself, as coarse steps of a slow movement do."""

    halts: int = 0
    """Runs of repeats, but for long ones and those at the ends."""
    leaps: int = 0
    """Halts that end in a leap."""
    steps: int = 0
    """Steps without a halt, for comparison."""
    plain_leaps: int = 0
    """Those of them that are leaps."""
    brief: int = 0
    """Repeats in the middle of a movement that last for a few frames only: no rest of a hand."""

    @property
    def share(self) -> float:
        return self.interrupted / max(self.interrupted + self.moving, 1)


class RepeatedSamples(RepairEffect):
    name = "repeated_samples"
    about = About(
        "Lost samples were filled with the one before: the recording halts and jumps.",
        source="padded samples of recorders without synchronisation: docs.optitrack.com, Manus in Motive",
        shown_over="time in take",
    )

    def find(
        self,
        takes: Sequence[Take],
        sensor_of: Mapping[str, str],
        errors: Sequence[np.ndarray] | None = None,
    ) -> tuple[Finding, ...]:
        check_signature_input(takes, sensor_of, errors)
        frames = [repeats(take.readings) for take in takes]
        rows = [repeats(take.reference) for take in takes]
        by_frames = _finding("frames", takes, frames)
        found = [by_frames, _finding("reference rows", takes, rows)]
        if by_frames is None:
            found.append(_finding_replayed(takes, replayed([take.readings for take in takes])))
            found.append(_finding_in_turn(takes, list(dict.fromkeys(sensor_of.values()))))
        return tuple(item for item in found if item is not None)

    def repaired(self, takes: Sequence[Take], settings: Settings | None = None) -> tuple[Take, ...]:
        """Without the repeated frames; repeated reference rows become unknown (NaN). Between the frames in
        which a sensor that is read in turn is new, its readings follow straight lines."""
        drop_frames = _is_found([repeats(take.readings) for take in takes])
        drop_rows = _is_found([repeats(take.reference) for take in takes])
        old = {} if drop_frames or not takes else _read_in_turn(takes, takes[0].sensors)
        readings = [take.readings for take in takes]
        again = [repeats(part).rows for part in readings] if drop_frames else replayed(readings)
        pairs = zip(takes, again, strict=True)
        return tuple(_renewed(_without(take, frames, drop_rows), old) for take, frames in pairs)


def repeats(values: np.ndarray) -> Repeats:
    """Repeats among rows of (N, K) values; a value that is NaN in both rows counts as repeated.

    Fewer rows than a movement takes say nothing.
    """
    if len(values) <= 2 * NEAR_FRAMES or not values.size:
        return Repeats(np.zeros(len(values), dtype=bool), 0, 0)
    steps = np.diff(values, axis=0)
    same = np.concatenate([[False], ((steps == 0) | (np.isnan(steps))).all(axis=1)])
    same &= np.isfinite(values).any(axis=1)
    fresh = np.flatnonzero(~same)
    quantum = np.array([smallest_step(column) for column in values.T])
    between = np.nan_to_num(np.diff(values[fresh], axis=0))
    clear = _clear(between, quantum)
    # Of each fresh row but first and last: some column steps clearly the same way before and after it.
    goes_on = ((clear[1:] * clear[:-1]) > 0).any(axis=1)
    padded = np.diff(fresh)[1:] > 1
    moving = np.zeros(len(values), dtype=bool)
    moving[fresh[1:]] = (clear != 0).any(axis=1)
    near = np.convolve(moving, np.ones(2 * NEAR_FRAMES + 1), mode="same") > 0
    together = float(same[near].mean()) if near.any() else 0.0
    interrupted, going = int((goes_on & padded).sum()), int((goes_on & ~padded).sum())
    leaping, lasts = _leaps(between, quantum), np.diff(fresh)[1:-1]
    halting = (lasts > 1) & (lasts <= LONGEST_HALT)
    missed = np.zeros(len(values), dtype=bool)
    for start, end in zip(fresh[1:-2][leaping & halting], fresh[2:-1][leaping & halting], strict=True):
        missed[start + 1 : end] = True
    brief = goes_on & padded & (np.diff(fresh)[1:] <= BRIEF_FRAMES)
    return Repeats(
        same & (near | missed), interrupted, going, together, _by_chance(values, steps, near, together),
        int(halting.sum()), int((leaping & halting).sum()), int((lasts == 1).sum()),
        int((leaping & (lasts == 1)).sum()), int(brief.sum()),
    )  # fmt: skip


def _clear(between: np.ndarray, quantum: np.ndarray) -> np.ndarray:
    """The signs of steps (S, K) between fresh rows, 0 where they may be noise."""
    limit = np.where(quantum > 0, CLEAR_STEP * quantum, np.inf)
    return np.where(np.abs(between) >= limit, np.sign(between), 0.0)


def _moments(readings: np.ndarray) -> tuple[int, int]:
    """``interrupted`` and ``moving`` of the ``repeats`` of one sensor's readings (N,) alone."""
    if len(readings) <= 2 * NEAR_FRAMES:
        return 0, 0
    steps = np.diff(readings)
    same = (steps == 0) | np.isnan(steps)
    fresh = np.flatnonzero(np.concatenate([[True], ~(same & np.isfinite(readings[1:]))]))
    clear = _clear(np.nan_to_num(np.diff(readings[fresh])), np.array(smallest_step(readings)))
    lasts = np.diff(fresh)[1:][clear[1:] * clear[:-1] > 0]
    interrupted = int((lasts > 1).sum())
    return interrupted, len(lasts) - interrupted


def _leaps(between: np.ndarray, quantum: np.ndarray) -> np.ndarray:
    """For each step (S, K) between fresh rows but the first and last: whether it is a leap."""
    quanta = np.abs(between[:, quantum > 0]) / quantum[quantum > 0]
    length, largest = quanta.sum(axis=1), quanta.max(axis=1, initial=0.0)
    around = np.maximum(length[:-2], length[2:])
    return (length[1:-1] >= LEAP_RATIO * around) & (largest[1:-1] >= LEAP_STEP)


def _by_chance(values: np.ndarray, steps: np.ndarray, near: np.ndarray, together: float) -> float:
    known = np.isfinite(values).any(axis=0)
    if known.sum() == 1:
        column = values[:, known]
        is_fine = len(np.unique(column[np.isfinite(column)])) > FINE_SHARE * len(column)
        return 0.0 if is_fine else together
    single = (steps[near[1:]][:, known] == 0).mean(axis=0) if near[1:].any() else np.zeros(1)
    return float(np.prod(single))


def _is_found(found: Sequence[Repeats]) -> bool:
    return _are_many(found) or _leap_beyond_chance(found)


def _leap_beyond_chance(found: Sequence[Repeats]) -> bool:
    halts, leaps, steps, plain = (
        sum(getattr(item, name) for item in found) for name in ("halts", "leaps", "steps", "plain_leaps")
    )
    if leaps < LEAST_LEAPS:
        return False
    chance = (plain + 1.0) / (steps + 2.0)
    return float(bdtrc(leaps - 1, halts, chance)) <= LEAPS_P_VALUE


def _are_many(found: Sequence[Repeats]) -> bool:
    interrupted, moving = sum(item.interrupted for item in found), sum(item.moving for item in found)
    together, by_chance = (
        float(np.mean([getattr(r, name) for r in found])) for name in ("together", "by_chance")
    )
    brief, moments = sum(item.brief for item in found), interrupted + moving
    if by_chance <= RARE_BY_CHANCE and brief >= max(LEAST_COUNT, RARELY_REPEATED_SHARE * moments):
        return True
    if interrupted < LEAST_COUNT or interrupted < LEAST_REPEATED_SHARE * moments:
        return False
    return together >= LEAST_REPEATED_SHARE + BEYOND_CHANCE * by_chance


def _finding(kind: str, takes: Sequence[Take], found: Sequence[Repeats]) -> Finding | None:
    if not _is_found(found):
        return None
    concerned = [
        (take, item) for take, item in zip(takes, found, strict=True) if item.interrupted or item.leaps
    ]
    count = sum(int(item.rows.sum()) for _, item in concerned)
    total = sum(len(item.rows) for item in found)
    interrupted = sum(item.interrupted for item in found)
    share = interrupted / max(interrupted + sum(item.moving for item in found), 1)
    names = tuple(take.name for take, _ in concerned)
    sentence = (
        f"{count} of {total} {kind} repeat the one before in the middle of a movement "
        f"({named(names)}); they were filled in and should be dropped."
    )
    evidence = {
        "repeated_share_of_moving_pct": 100.0 * share,
        "interrupted_movements_count": interrupted,
        "leaps_after_halts_count": sum(item.leaps for item in found),
    }
    return Finding(RepeatedSamples.name, names, sentence, kind=kind, count=count, evidence=evidence)


def _finding_replayed(takes: Sequence[Take], again: Sequence[np.ndarray]) -> Finding | None:
    count, total = (sum(int(method(part)) for part in again) for method in (np.sum, np.size))
    if not count:
        return None
    names = tuple(take.name for take, part in zip(takes, again, strict=True) if part.any())
    sentence = (
        f"{count} of {total} frames come a second time, in runs ({named(names)}): a buffer was played again;"
        " they should be dropped."
    )
    evidence = {"replayed_share_of_frames_pct": 100.0 * count / total}
    return Finding(RepeatedSamples.name, names, sentence, kind="runs", count=count, evidence=evidence)


def _read_in_turn(takes: Sequence[Take], sensors: Sequence[str]) -> dict[str, float]:
    """Sensors that are new in few frames, with the share of moments at which each repeats; none where it is
    less than half of those that move."""
    shares = {}
    for sensor in sensors:
        if not all(sensor in take.sensors for take in takes):
            continue
        found = [_moments(take.readings[:, take.sensors.index(sensor)]) for take in takes]
        interrupted, moving = (sum(counts) for counts in zip(*found, strict=True))
        if interrupted + moving >= FEWEST_MOMENTS:
            shares[sensor] = interrupted / (interrupted + moving)
    old = {sensor: share for sensor, share in shares.items() if share >= OLD_SHARE}
    return old if 2 * len(old) > len(shares) else {}


def _finding_in_turn(takes: Sequence[Take], sensors: Sequence[str]) -> Finding | None:
    old = _read_in_turn(takes, sensors)
    if not old:
        return None
    share = float(np.mean(list(old.values())))
    sentence = (
        f"{named(list(old))} hold an old reading at {share:.0%} of the moments inside their movements, each"
        " at moments of its own: they are read in turn. Between new readings straight lines are drawn; live"
        " poses stay as late as the glove's round of sensors."
    )
    names = tuple(take.name for take in takes)
    evidence = {"repeated_share_of_moving_pct": 100.0 * share, "sensors_count": float(len(old))}
    return Finding(RepeatedSamples.name, names, sentence, kind="sensors", evidence=evidence)


def _renewed(take: Take, sensors: Collection[str]) -> Take:
    """With straight lines between the new readings of ``sensors``."""
    if not sensors or len(take.readings) < 2:
        return take
    readings, time = take.readings.astype(float), take.time_s
    for sensor in sensors:
        column = take.sensors.index(sensor)
        new = np.flatnonzero(np.diff(readings[:, column], prepend=np.nan) != 0)
        lasts = np.diff(new)
        if not len(lasts):
            continue
        # A joint at rest holds its reading for longer than a round of the sensors: it moves in the last one.
        rested = new[1:] - round(float(np.median(lasts)))
        known = np.union1d(new, rested[rested > new[:-1]])
        readings[:, column] = np.interp(time, time[known], readings[known, column])
    return replace(take, readings=readings)


def _without(take: Take, frames: np.ndarray, drop_rows: bool) -> Take:
    """Without those of the frames (N,), and the repeated rows of the reference."""
    if drop_rows and len(take.reference):
        unknown = repeats(take.reference).rows[:, None]
        take = replace(take, reference=np.where(unknown, np.nan, take.reference))
    if frames.any():
        keep = ~frames
        poses = take.poses
        take = replace(
            take,
            time_s=take.time_s[keep],
            readings=take.readings[keep],
            context={name: column[keep] for name, column in take.context.items()},
            poses=None if poses is None else tuple(np.array(poses, dtype=object)[keep].tolist()),
        )
    return take
