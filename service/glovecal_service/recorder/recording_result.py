"""What a finished recording leaves behind: a take of its subject with the recording's account."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from glovecal_models.errors import BadInput
from glovecal_models.hand.handedness import Handedness, known_hand
from glovecal_service.recorder.recording_account import Settlement
from glovecal_service.recorder.recording_take import read_take
from glovecal_service.recorder.run_books import OWN_CLOCK
from glovecal_service.recorder.run_ledger import CAPTURE, SUFFIX
from glovecal_service.store.errors import NotFound
from glovecal_service.store.recordings import ENDED_BY
from glovecal_service.store.records import RecordingRecord, TakeRecord
from glovecal_service.store.store import Store


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
    told = [f"{counts}, {account['missing_frames']} missing"]
    told += [f"the capture log cannot tell of all: {why}"] if why else []
    told += [record.facts[ENDED_BY]] if ENDED_BY in record.facts else []
    return "; ".join(told)
