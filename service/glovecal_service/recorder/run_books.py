"""The books of one run in a recording: which frames were sent, which are recorded, where numbers jumped.

Sets of numbers are kept as ranges: a recording of hours without a gap is a single one.

Between two frames a glove sends no more than the time between them allows, by the frames' own clock: when
they arrived tells nothing, for what waited while somebody stood still arrives at once. Numbers that run ahead
of that clock begin a new stretch. Those between are in doubt: the capture log, asked, has them, or they were
never sent.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

from glovecal_client.plausible_loss import BURST_FRAMES, PlausibleLoss
from glovecal_client.wire.frame import Frame


class SequenceRanges:
    """Numbers that were recorded, as disjoint ranges with both ends included."""

    def __init__(self, numbers: Iterable[int] = ()) -> None:
        self._firsts: list[int] = []
        self._lasts: list[int] = []
        self._count = 0
        for number in numbers:
            self.add(number)

    @classmethod
    def of(cls, ranges: Iterable[Sequence[int]]) -> SequenceRanges:
        """Disjoint ranges in order, each with both ends."""
        made = cls()
        for first, last in ranges:
            made._firsts.append(first)
            made._lasts.append(last)
            made._count += last - first + 1
        return made

    def __len__(self) -> int:
        return self._count

    def __contains__(self, number: int) -> bool:
        at = bisect_right(self._firsts, number) - 1
        return at >= 0 and number <= self._lasts[at]

    def __iter__(self) -> Iterator[tuple[int, int]]:
        return iter(list(zip(self._firsts, self._lasts, strict=True)))

    @property
    def first(self) -> int | None:
        return self._firsts[0] if self._firsts else None

    @property
    def last(self) -> int | None:
        return self._lasts[-1] if self._lasts else None

    def add(self, number: int) -> bool:
        """Put ``number`` in; False if it was there."""
        if number in self:
            return False
        at = bisect_right(self._firsts, number)
        joins_before = at > 0 and self._lasts[at - 1] == number - 1
        joins_after = at < len(self._firsts) and self._firsts[at] == number + 1
        if joins_before and joins_after:
            self._lasts[at - 1] = self._lasts.pop(at)
            self._firsts.pop(at)
        elif joins_before:
            self._lasts[at - 1] = number
        elif joins_after:
            self._firsts[at] = number
        else:
            self._firsts.insert(at, number)
            self._lasts.insert(at, number)
        self._count += 1
        return True

    def append(self, later: SequenceRanges) -> None:
        """Put in numbers that are all higher than these."""
        for first, last in later:
            if self._lasts and self._lasts[-1] == first - 1:
                self._lasts[-1] = last
            else:
                self._firsts.append(first)
                self._lasts.append(last)
        self._count += len(later)

    def missing(self, first: int, last: int) -> list[tuple[int, int]]:
        """The ranges of ``first`` to ``last`` that are not in, in order."""
        gaps = []
        at = first
        for low, high in self:
            if high < at:
                continue
            if low > last:
                break
            if low > at:
                gaps.append((at, low - 1))
            at = high + 1
        if at <= last:
            gaps.append((at, last))
        return gaps


OWN_CLOCK = "own_clock"


@dataclass
class Stretch:
    """Numbers that were given one after another, as far as the clock of their frames tells."""

    first: int
    last: int
    """The last number given, as far as is known; ``first - 1``: none."""
    first_ns: int = 0
    last_ns: int = 0
    """Monotonic clock of capture: at the first and at the newest frame recorded; 0 before there is one."""
    recorded: SequenceRanges = field(default_factory=SequenceRanges)
    asked: bool = False
    """Whether the capture log was asked for what lies between the stretch before and this one."""

    @classmethod
    def of(cls, frame: Frame) -> Stretch:
        stretch = cls(frame.sequence, frame.sequence - 1)
        stretch.enter(frame)
        return stretch

    def lacks(self, sequence: int) -> bool:
        return self.first <= sequence <= self.last and sequence not in self.recorded

    def enter(self, frame: Frame) -> None:
        self.recorded.add(frame.sequence)
        self.first_ns = self.first_ns or frame.monotonic_ns
        self.last = max(self.last, frame.sequence)
        self.last_ns = max(self.last_ns, frame.monotonic_ns)

    def reaches(self, sequence: int, at_ns: int) -> bool:
        """Whether a glove can have sent all between the last number and ``sequence``, sent at ``at_ns``."""
        lost = sequence - self.last - 1
        return lost >= 0 and PlausibleLoss(self.last_ns).allows(lost, at_ns)

    def join(self, later: Stretch) -> None:
        self.recorded.append(later.recorded)
        self.last, self.last_ns = later.last, max(self.last_ns, later.last_ns)


class RunBooks:
    """The frames of one start of the capture daemon."""

    def __init__(self, run_id: int, first: int, began_wall_ns: int, *, since_wall_ns: int = 0) -> None:
        """``first``: where the recording begins in this run, 0 for one that began while it was going on.

        Wall clocks are capture's: when the recording began in this run, and the last time before the run's
        first frame at which all was accounted for.
        """
        self.run_id = run_id
        self.began_wall_ns = began_wall_ns
        self.first = first
        """Where the recording begins."""
        self.newest = Stretch(first, first - 1)
        """With the frame that came last."""
        self.stretches = [self.newest]
        """By their numbers, which none shares with another."""
        self.repaired = 0
        """Of the recorded frames, those fetched from the capture log."""
        self.last_wall_ns = 0
        """Of the newest frame recorded."""
        self.ended = False
        """Capture said that the run is over, and what its last number was."""
        self.given = -1
        """The highest number that capture said it gave."""
        self.own_clock: dict[str, Any] | None = None
        """How the glove's own clock stood against the computer's, as capture said last."""
        self._since_wall_ns = since_wall_ns

    @property
    def last(self) -> int:
        """The last number that belongs to the recording, as far as is known; ``first - 1``: none."""
        return self.newest.last

    def note_given(self, sequence: int) -> None:
        """Capture said that it gave this number."""
        self.given = max(self.given, sequence)
        later = [part.first - 1 for part in self.stretches if part.first > self.newest.last]
        self.newest.last = max(self.newest.last, min([sequence, *later]))

    def missing(self) -> list[tuple[int, int]]:
        return [gap for part in self.stretches for gap in part.recorded.missing(part.first, part.last)]

    def doubtful(self) -> list[tuple[int, int]]:
        """Numbers that were jumped over, and for which the capture log was not asked yet."""
        return [
            (max(before.last + 1, self.first), after.first - 1)
            for before, after in pairwise(self.stretches)
            if not after.asked and max(before.last + 1, self.first) < after.first
        ]

    def note_asked(self, first: int, last: int) -> None:
        """The capture log has given all it has of these numbers."""
        for part in self.stretches:
            part.asked = part.asked or first < part.first <= last + 1

    @property
    def sent(self) -> int:
        return sum(part.last - part.first + 1 for part in self.stretches)

    @property
    def recorded_frames(self) -> int:
        return sum(len(part.recorded) for part in self.stretches)

    def lacks(self, sequence: int) -> bool:
        """Whether the frame is missing."""
        return any(part.lacks(sequence) for part in self.stretches)

    def has(self, sequence: int) -> bool:
        return any(sequence in part.recorded for part in self.stretches)

    def enter(self, frame: Frame) -> bool:
        """Note a frame as recorded; False if one of its number is, or it does not belong to the recording."""
        if self.has(frame.sequence):
            return False
        at = bisect_right(self.stretches, frame.sequence, key=lambda part: part.first) - 1
        before = self.stretches[at] if at >= 0 else None
        if before is not None and before.lacks(frame.sequence):
            before.enter(frame)
        elif (before is None and frame.repaired) or self._is_late(frame):
            return False
        else:
            self._enter_between(at, frame)
        self.repaired += frame.repaired
        if frame.sequence >= self.last:
            self.last_wall_ns = frame.wall_ns
        return True

    def _is_late(self, frame: Frame) -> bool:
        if frame.repaired or frame.sequence > self.last:
            return False
        if self.newest.recorded:
            return frame.monotonic_ns <= self.newest.last_ns
        # on its way when capture said where it stood
        return self.first - frame.sequence <= BURST_FRAMES

    def _enter_between(self, at: int, frame: Frame) -> None:
        """After stretch ``at``, as a part of it or as one of its own; before all of them if ``at`` is -1."""
        before = self.stretches[at] if at >= 0 else None
        part = before if before and self._reach(before, frame) else Stretch.of(frame)
        if not frame.repaired or before is self.newest:
            self.newest = part
        if part is before:
            part.enter(frame)
        else:
            if at < 0:
                self.stretches = [each for each in self.stretches if each.first <= each.last]
            self.stretches.insert(at + 1, part)
        self._join_next(self.stretches.index(part))

    def _reach(self, part: Stretch, frame: Frame) -> bool:
        if part.recorded:
            return part.reaches(frame.sequence, frame.monotonic_ns)
        lost = frame.sequence - part.last - 1
        return lost >= 0 and PlausibleLoss(self._since_wall_ns).allows(lost, frame.wall_ns)

    def _join_next(self, at: int) -> None:
        """Two stretches are one where what lies between can have been sent."""
        if at + 1 < len(self.stretches):
            part, later = self.stretches[at], self.stretches[at + 1]
            if part.last_ns <= later.first_ns and part.reaches(later.first, later.first_ns):
                part.join(later)
                del self.stretches[at + 1]
                self.newest = part if self.newest is later else self.newest

    def take_over(self, before: RunBooks) -> None:
        """What capture said while these books were kept ``before``."""
        self.ended, self.own_clock = before.ended, before.own_clock
        if before.given >= 0:
            self.note_given(before.given)

    def count_again(self) -> None:
        """Nothing is recorded any more: every frame is entered anew."""
        self.repaired = self.last_wall_ns = 0
        for part in self.stretches:
            part.recorded = SequenceRanges()

    def document(self) -> dict[str, Any]:
        """``sent`` equals ``recorded`` plus the frames in ``missing``, which may still come."""
        return {
            "run_id": f"{self.run_id:016x}",
            "first_sequence": self.first,
            "last_sequence": self.last,
            "sent": self.sent,
            "recorded": self.recorded_frames,
            "repaired": self.repaired,
            "missing": [list(gap) for gap in self.missing()],
        } | ({} if self.own_clock is None else {OWN_CLOCK: self.own_clock})
