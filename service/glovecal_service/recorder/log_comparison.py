"""Whether what was recorded is what the capture daemon logged: block by block, by a digest of each.

Anybody in the network can publish frames that look like the glove's. Only the frames of a block whose digests
differ are fetched and compared one by one. Those that differ from the log's, and those with numbers that
capture never gave, leave the recording.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import zenoh

from glovecal_client.errors import NoAnswer, QueryRefused, WireError
from glovecal_client.gap_repair import BlockDigest, as_logged, digest_of
from glovecal_client.wire.frame import decode_frame, encode_frame
from glovecal_service.plain import reason_of
from glovecal_service.recorder.reconciliation import (
    WAITING_FOR_ROOM,
    CaptureStanding,
    Log,
    Outcome,
    OutOfTime,
    Patience,
    reconcile,
)
from glovecal_service.recorder.run_ledger import RecordedFrames, RunLedger

PAUSE_S = 0.005
"""Between two blocks: capture has its glove to read."""

ROWS_AT_ONCE = 4096
"""Read of a recording."""
ROUNDS = 3
"""What was taken out leaves gaps; what fills them came from the log."""


@dataclass(frozen=True)
class Comparison:
    """Of all that is recorded."""

    taken_out: int = 0
    """Frames that were not the capture's; they left the books of the recording."""
    not_logged: int = 0
    """Frames that stay, although the log does not have them: capture gave their numbers, as far as is known.
    Its disk was full, or the log is damaged."""


def reconcile_and_compare(
    file: RunLedger, log: Log, stop_wall_ns: int | None, time_left: Patience
) -> Outcome:
    """As ``reconcile``; then what is recorded is compared with the log, and what it lacks then is fetched."""
    outcome = reconcile(file, log, stop_wall_ns, time_left)
    if not outcome.complete:
        return outcome
    for _ in range(ROUNDS):
        try:
            standing = log.standing()
            comparison = compare(file, log, standing, time_left)
        except QueryRefused as error:
            return replace(outcome, not_compared=reason_of(error))
        except (NoAnswer, WireError, zenoh.ZError) as error:
            return replace(outcome, not_compared=reason_of(error), may_be_compared=True)
        except OutOfTime:
            return replace(outcome, not_compared="the capture log has more to tell", may_be_compared=True)
        why = f"{comparison.not_logged} frames are not in it" if comparison.not_logged else ""
        if not comparison.taken_out:
            if why and standing.disk_full:
                return replace(outcome, not_compared=WAITING_FOR_ROOM, may_be_compared=True)
            return replace(outcome, not_compared=why)
        outcome = reconcile(file, log, stop_wall_ns, time_left)
        if not outcome.complete:
            return outcome
    return replace(outcome, not_compared="the capture log tells something else each time")


def compare(file: RunLedger, log: Log, standing: CaptureStanding, time_left: Patience) -> Comparison:
    """Hold every frame of ``file`` against the capture log, and take out what is not from there.

    Raises NoAnswer, WireError, OutOfTime; QueryRefused where a run has no log, when all others were compared.
    """
    refused: QueryRefused | None = None
    unheard: dict[int, RecordedFrames] = {}
    compared: dict[int, tuple[RecordedFrames, set[int], set[int]]] = {}
    for run_id, frames in file.recorded().items():
        try:
            strange, unknown = _compared(run_id, frames, log, time_left)
        except QueryRefused as error:
            refused, unheard[run_id] = error, frames
            continue
        compared[run_id] = frames, strange, unknown
    began_ns = [
        at_ns
        for frames, strange, unknown in compared.values()
        for at_ns in _first_logged_ns(frames, unknown | strange)
    ]
    out: dict[int, set[int]] = {}
    not_logged = 0
    for run_id, (frames, strange, unknown) in compared.items():
        never = _never_given(file, run_id, unknown) | _out_of_order(frames, unknown, strange, began_ns)
        not_logged += len(unknown - strange - never)
        if strange | never:
            out[run_id] = strange | never
    if unheard:
        periods = [
            _period(frames, unknown | strange, goes_on=run_id == standing.runs[-1].run_id)
            for run_id, (frames, strange, unknown) in compared.items()
        ]
        for run_id, frames in unheard.items():
            if strange := _while_another_run_went_on(frames, list(filter(None, periods))):
                out[run_id] = strange
    for run_id, strange in out.items():
        file.take_out(run_id, sorted(strange))
    taken_out = sum(map(len, out.values()))
    if refused is not None and not taken_out:
        raise refused
    return Comparison(taken_out, not_logged)


Times = tuple[int, int]
"""Of a frame: monotonic and wall clock of capture, nanoseconds."""
NEVER: Times = (1 << 63, 1 << 63)


def _times(frames: RecordedFrames, rows: slice | Sequence[int]) -> list[Times]:
    """Raises OSError."""
    found = map(decode_frame, frames.messages(rows))
    return [(frame.monotonic_ns, frame.wall_ns) for frame in found]


def _never_given(file: RunLedger, run_id: int, unknown: set[int]) -> set[int]:
    """Of the numbers that the log does not have, those that capture did not give: they are higher than its
    last one, or were jumped to by more than a glove can send, and the log knows none of those after the jump.
    """
    reached = file.reached.get(run_id)
    beyond = {sequence for sequence in unknown if reached is not None and sequence > reached}
    for stretch in file.runs[run_id].stretches[1:]:
        jumped_to = [number for first, last in stretch.recorded for number in range(first, last + 1)]
        if all(number in unknown for number in jumped_to):
            beyond.update(jumped_to)
    return beyond


def _out_of_order(
    frames: RecordedFrames, unknown: set[int], strange: set[int], began_ns: list[int]
) -> set[int]:
    """Of the numbers that the log does not have, those whose time is not between the times of the logged
    frames before and after, the first ones of later runs (``began_ns``) among these: capture numbers its
    frames as time goes, one run after another. That is known of a killed capture too.
    """
    if not unknown:
        return set()
    sequences = frames.sequences.tolist()
    logged = [row for row, number in enumerate(sequences) if number not in unknown and number not in strange]
    asked = [row for row, number in enumerate(sequences) if number in unknown]
    places = [bisect_left(logged, row) for row in asked]
    needed = sorted({*asked, *(row for at in places for row in logged[max(0, at - 1) : at + 1])})
    time_ns = dict(zip(needed, (at_ns for at_ns, _ in _times(frames, needed)), strict=True))
    impossible = set()
    for row, at in zip(asked, places, strict=True):
        at_ns = time_ns[row]
        before_ns = time_ns[logged[at - 1]] if at > 0 else at_ns - 1
        is_late = at < len(logged) and at_ns >= time_ns[logged[at]]
        if at_ns <= before_ns or is_late or any(before_ns < first_ns <= at_ns for first_ns in began_ns):
            impossible.add(sequences[row])
    return impossible


def _first_logged_ns(frames: RecordedFrames, not_logged: set[int]) -> list[int]:
    """The time of a run's first logged frame, if there is one."""
    for row, number in enumerate(frames.sequences.tolist()):
        if number not in not_logged:
            return [_times(frames, [row])[0][0]]
    return []


def _period(frames: RecordedFrames, not_logged: set[int], *, goes_on: bool) -> tuple[Times, Times] | None:
    """When a run went on, by its logged frames: earliest and latest by each clock, as the wall clock may have
    been set meanwhile; one that goes on has no latest. None where nothing is logged.
    """
    logged = [times for number, times in _numbered_times(frames) if number not in not_logged]
    if not logged:
        return None
    monotonic_ns, wall_ns = zip(*logged, strict=True)
    return (min(monotonic_ns), min(wall_ns)), NEVER if goes_on else (max(monotonic_ns), max(wall_ns))


def _numbered_times(frames: RecordedFrames) -> Iterator[tuple[int, Times]]:
    for begin in range(0, len(frames), ROWS_AT_ONCE):
        rows = slice(begin, begin + ROWS_AT_ONCE)
        yield from zip(frames.sequences[rows].tolist(), _times(frames, rows), strict=True)


def _while_another_run_went_on(frames: RecordedFrames, periods: list[tuple[Times, Times]]) -> set[int]:
    """Of a run that no log is there of, the numbers of the frames that were captured, by both clocks, while a
    logged run went on: a capture has one run at a time.
    """
    return {
        number
        for number, (at_ns, wall_ns) in _numbered_times(frames)
        if any(first[0] <= at_ns <= last[0] and first[1] <= wall_ns <= last[1] for first, last in periods)
    }


def _compared(
    run_id: int, frames: RecordedFrames, log: Log, time_left: Patience
) -> tuple[set[int], set[int]]:
    """Numbers of frames that differ from the log's, and of those that the log does not have."""
    strange: set[int] = set()
    unknown: set[int] = set()
    at, last = 0, int(frames.sequences[-1])
    while at < len(frames):
        if time_left.is_over:
            raise OutOfTime
        first = int(frames.sequences[at])
        digest = _digest(log, run_id, first, last)
        if digest is None:
            unknown.update(frames.sequences[at:].tolist())
            break
        until = at + int(np.searchsorted(frames.sequences[at:], digest.last, side="right"))
        if until == at:
            raise WireError(f"the capture log of run {run_id:016x} answers for none of the frames asked for")
        rows = slice(at, until)
        messages = frames.messages(rows)
        if digest.frames != len(messages) or digest.sha256 != digest_of(messages):
            logged = _logged(log, run_id, first, digest.last, time_left)
            for sequence, message in zip(frames.sequences[rows].tolist(), messages, strict=True):
                if sequence not in logged:
                    unknown.add(sequence)
                elif logged[sequence] != message:
                    strange.add(sequence)
        at = until
        time_left.wait(PAUSE_S)
    return strange, unknown


def _digest(log: Log, run_id: int, first: int, last: int) -> BlockDigest | None:
    """A digest that nothing equals, of a capture that gives none but has the run's log."""
    try:
        return log.digest(run_id, first, last)
    except QueryRefused:
        block = log.block(run_id, first, last)
        return BlockDigest(-1, block[0].sequence, block[-1].sequence, "") if block else None


def _logged(log: Log, run_id: int, first: int, last: int, time_left: Patience) -> dict[int, bytes]:
    frames: dict[int, bytes] = {}
    while first <= last and (block := log.block(run_id, first, last)):
        frames |= {frame.sequence: as_logged(encode_frame(frame)) for frame in block}
        first = block[-1].sequence + 1
        if time_left.is_over:
            raise OutOfTime
    return frames
