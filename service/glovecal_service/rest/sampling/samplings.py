"""``sampling``: a person is led through poses and motions, and the takes of it."""

from __future__ import annotations

import asyncio
import secrets
import time
from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import APIRouter, Depends, Header, Query, Response
from fastapi.sse import EventSourceResponse, ServerSentEvent
from pydantic import BaseModel, Field, FiniteFloat

from glovecal_models.hand.handedness import known_hand
from glovecal_models.sampling.catalogue import ROD_MM, Equipment, ProtocolName, make_protocol
from glovecal_models.sampling.engine import Sampling, begin_sampling
from glovecal_models.sampling.guided.touch_watch import require_possible_touches
from glovecal_models.sampling.order import Order
from glovecal_models.sampling.state import SamplingState, Trigger
from glovecal_models.sampling.user_events import Event, NotNow
from glovecal_service.rest.http.answers import change_problems, problems
from glovecal_service.rest.http.damaged_rows import without_damaged
from glovecal_service.rest.http.dependencies import StoreNeeded
from glovecal_service.rest.http.request_types import (
    IDENTIFIER,
    Channel,
    Identifier,
    IdInPath,
    StrictBody,
    SubjectName,
    WearingName,
)
from glovecal_service.store.errors import Conflict
from glovecal_service.store.records import SamplingRecord
from glovecal_service.store.sampling_reuse import reuse_takes
from glovecal_service.views.sampling import SamplingView, TargetView, sampling_view, target_view

router = APIRouter(prefix="/sampling", tags=["sampling"])

LOOK_EVERY_S = 0.1
LONGEST_STREAM_S = 3600.0
"""After this the stream ends; listeners connect again."""
MOST_TRIES = 20
LARGEST_SEED = 2**31 - 1
Angles = Annotated[list[FiniteFloat], Field(max_length=20)]
PoseAngles = Annotated[dict[Channel, FiniteFloat], Field(max_length=100)]


class NewSampling(StrictBody):
    glove: Identifier
    subject: SubjectName
    wearing: WearingName | None = Field(None, description="None: the glove's wearing.")
    protocol: ProtocolName = "new_subject"
    trigger: Trigger = Field(
        "key",
        description="What begins a step: a key or pedal, a timer, a still hand (motions, widgets: a timer).",
    )
    widget_deg: Annotated[dict[Channel, Angles], Field(max_length=100)] = Field(
        default_factory=dict, description="Widgets by the rotation that they hold, instead of the usual."
    )
    pose_deg: Annotated[dict[Identifier, PoseAngles], Field(max_length=20)] = Field(
        default_factory=dict, description="Measured angles by pose, instead of the usual; new poses too."
    )
    order: Order = Field(
        "random",
        description="Of poses and widgets: `random`, the first again at the end, so that a drift cannot look "
        "like posture; or `fixed`, the paper's. Protocol `active` chooses its own.",
    )
    seed: Annotated[int, Field(ge=0, le=LARGEST_SEED)] | None = Field(
        None, description="Of the random order; None: a new one. It is kept with the sampling."
    )
    rod_mm: Annotated[list[FiniteFloat], Field(max_length=5)] = Field(
        default_factory=lambda: [ROD_MM], description="Rods to hold between the fingertips."
    )


class Change(StrictBody):
    step: Annotated[str, Field(max_length=100)] | None = Field(None, description="For `redo`: which step.")
    angle_deg: FiniteFloat | None = Field(
        None, description="For `redo`: the angle that the step's widget really has."
    )


class Reuse(StrictBody):
    subject: SubjectName = Field(description="For whom the takes are to be used too.")


class Reused(BaseModel):
    takes: list[str] = Field(description="New takes, marked as rough.")
    left_out: list[str] = Field(description="Why others cannot be used, in sentences.")


@router.post(
    "",
    status_code=201,
    response_model=SamplingView,
    summary="Start a guided sampling",
    responses=change_problems(409),
)
def start_sampling(body: NewSampling, store: StoreNeeded, response: Response) -> SamplingView:
    """404 when the glove was never seen, 409 while it is in another sampling, 422 for a touch that the
    subject's hand cannot do."""
    glove = store.gloves.get(body.glove)
    if glove.layout is None:
        raise Conflict(f"glove {glove.name!r} has not said which layout it has; is its capture running?")
    layout = store.layouts.get(glove.layout)
    equipment = Equipment(body.widget_deg, body.pose_deg, tuple(body.rod_mm))
    seed = body.seed if body.seed is not None else secrets.randbelow(LARGEST_SEED + 1)
    protocol = make_protocol(body.protocol, layout, equipment, seed=seed if body.order == "random" else None)
    person = store.subjects.get(body.subject)
    if person.dimensions:
        require_possible_touches(protocol, person.skeleton(known_hand(glove.hand)))
    sensors = [str(sensor) for sensor in glove.meta.get("sensors") or layout.sensors]
    state = begin_sampling(
        protocol,
        sensors,
        trigger=body.trigger,
        counts=layout.counts,
        now_s=time.time(),
    )
    record = store.samplings.create(
        glove=body.glove,
        subject=body.subject,
        wearing=body.wearing or glove.wearing or "",
        layout=glove.layout,
        document=state.to_document(),
    )
    response.headers["Location"] = f"/v1/sampling/{record.id}"
    return sampling_view(record)


@router.get("", response_model=list[SamplingView], summary="Samplings, newest first", responses=problems())
def list_samplings(
    store: StoreNeeded,
    response: Response,
    glove: Annotated[str | None, Query(pattern=IDENTIFIER)] = None,
    only_open: bool = False,
) -> list[SamplingView]:
    """Damaged rows are left out and named in `Warning` headers."""
    records = without_damaged(response, lambda: store.samplings.list(glove=glove, only_open=only_open))
    return [sampling_view(record) for record in records]


@router.get("/{id}", response_model=SamplingView, summary="One sampling", responses=problems())
def get_sampling(id: IdInPath, store: StoreNeeded) -> SamplingView:
    return sampling_view(store.samplings.get(id))


@router.get(
    "/{id}/target",
    response_model=TargetView,
    summary="What the step at hand looks like, for viewers",
    responses=problems(),
)
def get_target(id: IdInPath, store: StoreNeeded) -> TargetView:
    """On the subject's own hand, so that fingertips which are to touch do so in the picture."""
    record = store.samplings.get(id)
    return target_view(record, store.subjects.get(record.subject).skeleton())


@router.post(
    "/{id}/reuse",
    status_code=201,
    response_model=Reused,
    summary="Use a sampling's takes for another person",
    responses=change_problems(409),
)
def reuse_sampling(id: IdInPath, body: Reuse, store: StoreNeeded) -> Reused:
    """FK samples calibrate sensors, roughly for everybody; IK samples depend on one hand and are left out."""
    takes, left_out = reuse_takes(store, store.samplings.get(id), body.subject)
    return Reused(takes=takes, left_out=left_out)


@router.post(
    "/{id}/{event}",
    response_model=SamplingView,
    summary="Go on, do again, take back, leave out, pause, resume, stop",
    responses=change_problems(409),
)
def change_sampling(
    id: IdInPath, event: Event, store: StoreNeeded, body: Change | None = None
) -> SamplingView:
    """409 when the event has no meaning now; the answer is what came of it."""
    wanted = body or Change(step=None, angle_deg=None)
    for _ in range(MOST_TRIES):
        record = store.samplings.get(id)
        sampling = Sampling(SamplingState.from_document(record.document))
        try:
            sampling.event(time.time(), event, step=wanted.step, angle_deg=wanted.angle_deg)
        except NotNow as error:
            raise Conflict(str(error)) from error
        kept = store.samplings.save(record, sampling.state.to_document())
        if kept is not None:
            return sampling_view(kept)
    raise Conflict(f"sampling {id} changes too fast; try again")


def _known_sampling(id: IdInPath, store: StoreNeeded) -> SamplingRecord:
    return store.samplings.get(id)


@router.get(
    "/{id}/events",
    response_class=EventSourceResponse,
    summary="A sampling as it goes on",
    responses=problems(),
)
async def sampling_events(
    sampling: Annotated[SamplingRecord, Depends(_known_sampling)],
    store: StoreNeeded,
    last_event_id: Annotated[int, Header(ge=0, le=2**62, description="Sentences said already.")] = 0,
) -> AsyncIterator[ServerSentEvent]:
    """Server-sent events: `say` for each new sentence (its number is the event's id), `state` with the whole
    sampling whenever it differs, `over` at the end."""
    until, shown = time.monotonic() + LONGEST_STREAM_S, None
    while time.monotonic() < until:
        record = await asyncio.to_thread(store.samplings.get, sampling.id)
        view = sampling_view(record)
        if view.say_number > last_event_id:
            last_event_id = view.say_number
            yield ServerSentEvent(event="say", id=str(last_event_id), data=view.say)
        told = (record.version, record.live, record.open, record.problem)
        if told != shown:
            shown = told
            yield ServerSentEvent(event="state", data=view.model_dump(mode="json"))
        if not record.open:
            yield ServerSentEvent(event="over", data=view.model_dump(mode="json"))
            return
        await asyncio.sleep(LOOK_EVERY_S)
