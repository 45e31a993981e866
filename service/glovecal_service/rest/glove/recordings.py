"""``recordings``: takes in the making; the real-time process carries them out."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query, Response
from pydantic import Field, FiniteFloat, StringConstraints

from glovecal_models.takes.time_code import FrameRate, TimeCode
from glovecal_service.request_types import (
    IDENTIFIER,
    ONE_LINE,
    Identifier,
    StrictBody,
    SubjectName,
    WearingName,
)
from glovecal_service.rest.glove.answer import Recording
from glovecal_service.rest.http.dependencies import StoreNeeded
from glovecal_service.rest.http.list_part import ByTime
from glovecal_service.rest.http.problem import change_problems, problems
from glovecal_service.rest.http.request_types import IdInPath, SubjectFilter
from glovecal_service.store.recordings import LONGEST_PRE_ROLL_S, PRE_ROLL_S
from glovecal_service.store.records import OPEN_RECORDING_STATES, RecordingRecord, RecordingState

router = APIRouter(prefix="/recordings", tags=["recordings"])


Sent = Annotated[str, StringConstraints(max_length=500, pattern=ONE_LINE)]
"""A field of a trigger, as it was sent."""


class Received(StrictBody):
    """What came from another system, and when."""

    wall_s: FiniteFloat = Field(description="When it came, Unix seconds of the computer it came to.")
    monotonic_s: FiniteFloat = Field(description="The same by that computer's monotonic clock.")
    computer: Annotated[str, StringConstraints(max_length=64, pattern=ONE_LINE)] = Field(
        description="Whose monotonic clock that is."
    )


class ReceivedTrigger(Received):
    """What another system said when it began or ended a recording."""

    protocol: Identifier
    sender: Sent = ""
    name: Sent = ""
    notes: Sent = ""
    description: Sent = ""
    result: Sent = ""
    time_code: Sent = Field("", description="As HH:MM:SS:FF; `;` before the frames is drop-frame.")
    rate: FrameRate | None = Field(
        None, description="Of the time code, frames a second; null: not known, or 29.97 drop-frame."
    )
    delay_s: Annotated[FiniteFloat, Field(ge=0, le=60)] = Field(
        0.0, description="From its arrival to what it speaks of."
    )


class RunningTimeCode(Received):
    """A frame of SMPTE time code that began at that time."""

    time_code: Sent = Field(description="HH:MM:SS:FF of the frame; `;` before the frames is drop-frame.")
    rate: FrameRate = Field(description="Frames a second.")
    source: Sent = Field(description="Where it comes from.")


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
    trigger: ReceivedTrigger | None = Field(None, description="By which another system began it.")


class RecordingEnd(StrictBody):
    name: WearingName | None = Field(None, description="What the take will be called instead.")
    trigger: ReceivedTrigger | None = Field(None, description="By which another system ended it.")


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
    paging: ByTime,
    glove: Annotated[str | None, Query(pattern=IDENTIFIER)] = None,
    subject: SubjectFilter = None,
    state: RecordingState | None = None,
    only_open: bool = False,
) -> list[RecordingRecord]:
    """Damaged rows are left out and named in `Warning` headers. More than `limit`: see `Link`."""
    states = OPEN_RECORDING_STATES if only_open else None if state is None else (state,)
    return paging.answer(store.recordings.page(paging.part, glove=glove, subject=subject, states=states))


@router.get("/{id}", response_model=Recording, summary="One recording", responses=problems())
def get_recording(id: IdInPath, store: StoreNeeded) -> RecordingRecord:
    return store.recordings.get(id)


@router.put(
    "/{id}/time-code",
    response_model=Recording,
    summary="Say which SMPTE time code runs while a glove is recorded",
    responses=change_problems(409),
)
def put_time_code(id: IdInPath, body: RunningTimeCode, store: StoreNeeded) -> RecordingRecord:
    """Its take will have it, by its own clock. 409 once the recording is over."""
    TimeCode.of_text(body.time_code, body.rate, body.monotonic_s, body.source)
    return store.recordings.note_time_code(id, body.model_dump())


@router.post("/{id}/stop", response_model=Recording, summary="Stop a recording", responses=change_problems())
def stop_recording(id: IdInPath, store: StoreNeeded, body: RecordingEnd | None = None) -> RecordingRecord:
    """Asking again changes nothing. The take is there once `state` is `done`, or `repairing`: then frames are
    not there yet, and the take is completed, and `done`, once the capture log could be asked for them."""
    return store.recordings.stop(id, **({} if body is None else body.model_dump()))
