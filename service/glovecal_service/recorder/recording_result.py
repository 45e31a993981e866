"""What a finished recording leaves behind: a take of its subject with the recording's account.

The account has every frame between its begin and its end, and what became of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from glovecal_client.frame_log import Recording
from glovecal_client.wire.frame import Frame
from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import Handedness, known_hand
from glovecal_models.takes.take import Take
from glovecal_service.recorder.pre_roll import PreRollRequest
from glovecal_service.recorder.reconciliation import Outcome
from glovecal_service.recorder.run_books import OWN_CLOCK, SequenceRanges
from glovecal_service.recorder.run_ledger import (
    CAPTURE,
    FINDINGS,
    SUFFIX,
    TAKEN_OUT,
    RunLedger,
    frames_taken_out,
    usable_frames,
)
from glovecal_service.recorder.trigger_times import trigger_facts
from glovecal_service.store.errors import NotFound
from glovecal_service.store.recordings import ENDED_BY, PRE_ROLL
from glovecal_service.store.records import RecordingRecord, TakeRecord
from glovecal_service.store.store import Store


@dataclass(frozen=True)
class Settlement:
    """What the end of a recording, or an attempt to repair it, came to."""

    account: dict[str, Any]
    outcome: Outcome

    @property
    def is_final(self) -> bool:
        """Whether nothing can come or be found out any more."""
        return self.outcome.complete and not self.outcome.may_be_compared

    @classmethod
    def of(cls, file: RunLedger, outcome: Outcome, **told: Any) -> Settlement:
        """Of a file that was closed; ``told`` is as in ``recording_account``."""
        if file.lost_records:
            outcome = Outcome(False, "the disk is full")
        account = recording_account(file, complete=outcome.complete, **told)
        return cls({**account, "compared": outcome.complete and not outcome.not_compared}, outcome)

    def given_up(self) -> Settlement:
        """What is pending is missing."""
        missing = {"missing": self.account["pending"], "missing_frames": self.account["pending_frames"]}
        account = self.account | missing | {"complete": True, "pending": [], "pending_frames": 0}
        why = self.outcome.not_compared or self.outcome.why
        return Settlement(account, Outcome(True, self.outcome.why, not_compared=why))


def recording_account(
    file: RunLedger, *, complete: bool, refused: int = 0, why_shorter: str | None = None
) -> dict[str, Any]:
    """Facts for the recording's row; ``sent`` = ``recorded`` + ``missing_frames`` + ``pending_frames``.

    ``missing`` are ranges that no log has, known once the account is ``complete``; until then what is not
    recorded is ``pending``: it may still be fetched. ``taken_out``: frames that came and were not the
    capture's, by its log; they count as nothing else. The pre-roll is counted apart, and nothing of it is
    ever missing; ``why_shorter`` is a clause on why it is shorter than asked for.
    """
    wish = PreRollRequest.of_document(file.meta.get(PRE_ROLL))
    if why_shorter is None:
        why_shorter = "the recording was interrupted" if file.pre_roll_s < wish.most_s - 1.0 else ""
    runs = [books.document() for books in file.runs.values()]
    gaps = [gap for run in runs for gap in run["missing"]]
    frames = sum(last - first + 1 for first, last in gaps)
    said_later = {} if CAPTURE in file.meta or not file.capture else {CAPTURE: file.capture}
    return said_later | {
        "complete": complete,
        "first_sequence": runs[0]["first_sequence"] if runs else None,
        "last_sequence": runs[-1]["last_sequence"] if runs else None,
        "sent": sum(run["sent"] for run in runs),
        "recorded": sum(run["recorded"] for run in runs),
        "repaired": sum(run["repaired"] for run in runs),
        "missing": gaps if complete else [],
        "missing_frames": frames if complete else 0,
        "pending": [] if complete else gaps,
        "pending_frames": 0 if complete else frames,
        "refused": refused,
        TAKEN_OUT: sum(map(len, file.taken_out.values())),
        FINDINGS: file.findings(),
        PRE_ROLL: wish.account(len(file.pre_roll), file.pre_roll_s, why_shorter),
        "runs": runs,
        "file": file.path.name,
    }


def keep_as_take(
    store: Store, record: RecordingRecord, settlement: Settlement, folder: Path
) -> dict[str, Any]:
    """Store the recording's take, or bring the one there is up to date; the facts that end the recording.

    A subject that only the capture daemon knew is created. A recording without a frame that may still be
    repaired has no take yet. Raises BadInput (nothing recorded, nobody wore the glove), StorageFull,
    Conflict.
    """
    account, sentence = settlement.account, _sentence(record, settlement)
    if not account["recorded"]:
        if not settlement.outcome.complete and account["runs"]:
            return {"sentence": sentence}
        raise BadInput(f"no frame of glove {record.glove} arrived; is its capture running?")
    glove = store.gloves.get(record.glove)
    subject = record.subject or glove.subject
    if subject is None:
        raise BadInput(
            f"nobody wore glove {record.glove}; its frames stay in {account['file']}. Assign a subject first"
        )
    layout = glove.layout
    if layout is None:
        raise BadInput(
            f"glove {record.glove} has not said which layout it has; frames stay in {account['file']}"
        )
    recorded = read_take(
        folder / f"{record.id}{SUFFIX}",
        name=record.name,
        wearing=record.wearing or "",
        first_sequence=account["first_sequence"],
        capture=record.facts.get(CAPTURE) or glove.meta,
        taken_out=frames_taken_out(account[FINDINGS]),
    )
    take = _stored_before(store, subject, record)
    accounting = {**account, **recorded.clock, OWN_CLOCK: _own_clock(account, take)}
    if take is None and "take" in record.facts:
        return {"sentence": f"{sentence}; its take was removed"}
    if take is None:
        _require_subject(store, subject, known_hand(recorded.clock["hand"]))
        take = store.takes.add(
            recorded.take,
            subject=subject,
            layout=_known_layout(store, subject, layout, recorded.take.sensors),
            source="recording",
            accounting=accounting,
            recording=record.id,
            facts=trigger_facts(record.facts, recorded.clock),
        )
    elif take.accounting != accounting:
        take = store.takes.repair(take.id, recorded.take, accounting)
    return {"take": take.id, "sentence": sentence}


def _own_clock(account: dict[str, Any], stored: TakeRecord | None) -> dict[str, Any] | None:
    """Of the last run that has one; a repair reads the frames again, and no status."""
    said = [run[OWN_CLOCK] for run in account["runs"] if OWN_CLOCK in run]
    return said[-1] if said else ((stored and stored.accounting) or {}).get(OWN_CLOCK)


def _stored_before(store: Store, subject: str, record: RecordingRecord) -> TakeRecord | None:
    """The take of this recording, also when a process died between storing it and saying so."""
    if "take" in record.facts:
        with suppress(NotFound):
            return store.takes.get(record.facts["take"])
        return None
    return next((take for take in store.takes.list(subject) if take.recording == record.id), None)


def _known_layout(store: Store, subject: str, said: str, sensors: Sequence[str]) -> str:
    """The layout the glove said; where nobody stored it, the subject's newest one of the same sensors."""
    known = {record.name: set(record.document["sensors"]) for record in store.layouts.list()}
    same = [name for name, names in known.items() if names == set(sensors)]
    if said in known or not same:
        return said
    used = [take.layout for take in store.takes.list(subject) if take.layout in same]
    return used[-1] if used else same[0]


def _require_subject(store: Store, subject: str, hand: Handedness | None) -> None:
    try:
        store.subjects.get(subject)
    except NotFound:
        store.subjects.create(subject, hand=hand)


def _sentence(record: RecordingRecord, settlement: Settlement) -> str:
    account, why = settlement.account, settlement.outcome.why
    counts = f"{account['sent']} frames sent, {account['recorded']} recorded ({account['repaired']} repaired)"
    if not settlement.outcome.complete:
        pending = f"{account['pending_frames']} still to be fetched from the capture log"
        return f"incomplete, repairing: {counts}, {pending}; {why}"
    parts = [f"{counts}, {account['missing_frames']} missing"]
    parts += [f"the capture log cannot tell of all: {why}"] if why else []
    out, why_not = account[TAKEN_OUT], settlement.outcome.not_compared
    parts += [f"{out} frames were not the capture's and were taken out"] if out else []
    parts += [f"not compared with the capture log{_yet(settlement)}: {why_not}"] if why_not else []
    parts += [record.facts[ENDED_BY]] if ENDED_BY in record.facts else []
    return "; ".join(parts)


def _yet(settlement: Settlement) -> str:
    return " yet" if settlement.outcome.may_be_compared else ""


# A finished recording file as a take.


@dataclass(frozen=True)
class RecordedTake:
    """The take, and what has to be known about its time and its glove."""

    take: Take
    clock: dict[str, Any]
    """``wall_minus_time_s``: add it to ``time_s`` for seconds since 1970; ``begins_s``: ``time_s`` of the
    first frame that was asked for, after the pre-roll; ``left_out``: frames not taken; ``computer``: whose
    monotonic clock ``time_s`` is of, and ``hand``: of the glove, null where capture did not say."""


def read_take(
    path: Path,
    *,
    name: str,
    wearing: str,
    first_sequence: int = 0,
    capture: Mapping[str, Any] | None = None,
    taken_out: Mapping[int, SequenceRanges] | None = None,
) -> RecordedTake:
    """The frames of all runs in order; ``time_s`` is the capture computer's monotonic clock in seconds.

    Fetched frames of the first run with numbers below ``first_sequence`` are the pre-roll. ``capture``: what
    it said of itself, where the file's header does not have it; ``taken_out``: by run, the numbers of frames
    that were not the capture's.
    Frames whose time does not increase, or with another number of sensors, are left out and counted.
    Raises BadInput if nothing usable remains, DamagedLog, OSError.
    """
    recording = Recording.open(path)
    frames = _in_order(list(usable_frames(recording, taken_out or {})))
    meta = recording.meta.get(CAPTURE) or capture or {}
    sensors = tuple(str(sensor) for sensor in meta.get("sensors") or ())
    if not sensors:
        raise BadInput(f"recording {path.name}: capture did not say which sensors its frames hold")
    usable = [frame for frame in frames if len(frame.readings) == len(sensors)]
    if not usable:
        raise BadInput(f"recording {path.name}: none of its {len(frames)} frames has {len(sensors)} sensors")
    time_s = _time_s(usable)
    kept = _increasing(time_s)
    taken = [frame for frame, keep in zip(usable, kept, strict=True) if keep]
    lead = sum(
        frame.repaired and frame.run_id == taken[0].run_id and frame.sequence < first_sequence
        for frame in taken
    )
    if lead == len(taken):
        raise BadInput(f"recording {path.name}: none of the frames asked for has {len(sensors)} sensors")
    begins_s = float(time_s[kept][lead])
    take = Take(
        name=name,
        wearing=wearing,
        sensors=sensors,
        time_s=time_s[kept],
        readings=np.array([frame.readings for frame in taken], dtype=np.float64),
        context=_context(taken, [str(item) for item in meta.get("context") or ()]),
        simulated=any(frame.simulated for frame in taken),
        begins_s=begins_s if lead else None,
    )
    offset = taken[lead].wall_ns / 1e9 - begins_s
    clock: dict[str, Any] = {
        "wall_minus_time_s": offset,
        "begins_s": begins_s,
        "left_out": len(frames) - len(taken),
    }
    clock["computer"] = meta.get("computer")
    clock["hand"] = meta.get("hand")
    return RecordedTake(take, clock)


def _in_order(frames: Sequence[Frame]) -> list[Frame]:
    """By run, in the order the runs began, and by sequence number: repaired frames were written late.

    Where a publisher's numbers went on from a lower one, by time. The run met first is the first.
    """
    began_ns: dict[int, int] = {}
    for frame in frames:
        began_ns[frame.run_id] = min(frame.wall_ns, began_ns.get(frame.run_id, frame.wall_ns))
    first, *others = began_ns
    order = {run: place for place, run in enumerate([first, *sorted(others, key=lambda run: began_ns[run])])}
    restarted = _restarted(frames)

    def place(frame: Frame) -> tuple[int, int]:
        return order[frame.run_id], frame.monotonic_ns if frame.run_id in restarted else frame.sequence

    return sorted(frames, key=place)


def _restarted(frames: Sequence[Frame]) -> set[int]:
    """Runs with frames that were recorded as they came, and are later than ones with higher numbers."""
    newest: dict[int, Frame] = {}
    found = set()
    for frame in frames:
        if frame.repaired:
            continue
        before = newest.get(frame.run_id, frame)
        if frame.sequence < before.sequence and frame.monotonic_ns > before.monotonic_ns:
            found.add(frame.run_id)
        newest[frame.run_id] = frame
    return found


def _time_s(frames: Sequence[Frame]) -> np.ndarray:
    """Monotonic seconds; a run after a restart of the computer is put in place by the wall clock."""
    time_s = np.array([frame.monotonic_ns for frame in frames]) / 1e9
    for at in range(1, len(frames)):
        before, after = frames[at - 1], frames[at]
        if after.run_id != before.run_id and time_s[at] <= time_s[at - 1]:
            step = max(1e-3, (after.wall_ns - before.wall_ns) / 1e9)
            time_s[at:] += time_s[at - 1] + step - time_s[at]
    return time_s


def _increasing(time_s: np.ndarray) -> np.ndarray:
    """Where the time is later than at every kept frame before."""
    latest = np.maximum.accumulate(time_s)
    return np.concatenate([[True], time_s[1:] > latest[:-1]])


def _context(frames: Sequence[Frame], names: Sequence[str]) -> dict[str, np.ndarray]:
    """Columns of the frames that carry all context values; columns never measured are dropped."""
    rows = [
        frame.context if len(frame.context) == len(names) else np.full(len(names), np.nan) for frame in frames
    ]
    values = np.array(rows, dtype=np.float64).reshape(len(frames), len(names))
    return {name: values[:, at] for at, name in enumerate(names) if np.isfinite(values[:, at]).any()}
