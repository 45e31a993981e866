"""What a finished recording leaves behind: a take of its subject with the recording's account."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from glovecal_models.errors import BadInput
from glovecal_service.realtime.recording_file import SUFFIX
from glovecal_service.realtime.recording_take import read_take
from glovecal_service.store.errors import NotFound
from glovecal_service.store.records import RecordingRecord, TakeRecord
from glovecal_service.store.store import Store


def keep_as_take(
    store: Store, record: RecordingRecord, account: Mapping[str, Any], folder: Path
) -> dict[str, Any]:
    """Store the recording's take, once, and return the facts that end the recording.

    A subject that only the capture daemon knew is created. Raises BadInput (nothing recorded, nobody wore
    the glove), StorageFull.
    """
    if not account["recorded"]:
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
    take = _stored_before(store, subject, record.id)
    if take is None:
        recorded = read_take(
            folder / f"{record.id}{SUFFIX}",
            name=record.name,
            wearing=record.wearing or "",
            first_sequence=account["first_sequence"],
        )
        _require_subject(store, subject)
        take = store.takes.add(
            recorded.take,
            subject=subject,
            layout=layout,
            source="recording",
            accounting={**account, **recorded.clock},
            recording=record.id,
        )
    return {"take": take.id, "sentence": _sentence(account)}


def _stored_before(store: Store, subject: str, recording: str) -> TakeRecord | None:
    """The take of this recording, when a process died between storing it and saying so."""
    return next((take for take in store.takes.list(subject) if take.recording == recording), None)


def _require_subject(store: Store, subject: str) -> None:
    try:
        store.subjects.get(subject)
    except NotFound:
        store.subjects.create(subject)


def _sentence(account: Mapping[str, Any]) -> str:
    counts = f"{account['sent']} frames sent, {account['recorded']} recorded ({account['repaired']} repaired)"
    missing = f"{account['missing_frames']} missing"
    if account.get("end_known", True):
        return f"{counts}, {missing}"
    return f"{counts}, {missing}; capture did not say how far it was at the end"
