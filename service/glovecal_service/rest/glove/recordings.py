"""``recordings``: takes in the making; the real-time process carries them out."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query, Response
from pydantic import Field

from glovecal_service.request_types import IDENTIFIER, Identifier, StrictBody, SubjectName, WearingName
from glovecal_service.rest.glove.answer import Recording
from glovecal_service.rest.http.dependencies import StoreNeeded
from glovecal_service.rest.http.problem import change_problems, problems, without_damaged
from glovecal_service.rest.http.request_types import IdInPath
from glovecal_service.store.recordings import LONGEST_PRE_ROLL_S, PRE_ROLL_S
from glovecal_service.store.records import RecordingRecord

router = APIRouter(prefix="/recordings", tags=["recordings"])


class NewRecording(StrictBody):
    glove: Identifier
    name: WearingName = Field(description="What the take will be called.")
    subject: SubjectName | None = Field(None, description="None: who wears the glove now.")
    wearing: WearingName | None = None
    lead_s: float = Field(
        PRE_ROLL_S,
        ge=0,
        le=LONGEST_PRE_ROLL_S,
        description="Seconds before the request that are fetched from the capture log, as far as they lie in "
        "the same run and wearing: they tell effects with a memory where they stand.",
    )


@router.post(
    "",
    status_code=201,
    response_model=Recording,
    summary="Start recording a glove",
    responses=change_problems(409),
)
def start_recording(body: NewRecording, store: StoreNeeded, response: Response) -> RecordingRecord:
    """404 when the glove was never seen, 409 while it is being recorded."""
    record = store.recordings.request(**body.model_dump())
    response.headers["Location"] = f"/v1/recordings/{record.id}"
    return record


@router.get("", response_model=list[Recording], summary="Recordings, newest first", responses=problems())
def list_recordings(
    store: StoreNeeded,
    response: Response,
    glove: Annotated[str | None, Query(pattern=IDENTIFIER)] = None,
    only_open: bool = False,
) -> list[RecordingRecord]:
    """Damaged rows are left out and named in `Warning` headers."""
    return without_damaged(response, lambda: store.recordings.list(glove, only_open=only_open))


@router.get("/{id}", response_model=Recording, summary="One recording", responses=problems())
def get_recording(id: IdInPath, store: StoreNeeded) -> RecordingRecord:
    return store.recordings.get(id)


@router.post("/{id}/stop", response_model=Recording, summary="Stop a recording", responses=change_problems())
def stop_recording(id: IdInPath, store: StoreNeeded) -> RecordingRecord:
    """Asking again changes nothing. The take is there once `state` is `done`, or `repairing`: then frames are
    not there yet, and the take is completed, and `done`, once the capture log could be asked for them."""
    return store.recordings.stop(id)
