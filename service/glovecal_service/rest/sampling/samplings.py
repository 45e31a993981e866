"""``sampling``: a person is led through poses and motions, and the takes of it."""

from __future__ import annotations

import secrets
import time
from collections.abc import AsyncIterator
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Header, Query, Response
from fastapi.sse import EventSourceResponse, ServerSentEvent
from pydantic import Field, FiniteFloat

from glovecal_models.hand.rotations import known_hand
from glovecal_models.hand.skeleton import Skeleton
from glovecal_models.sampling.catalogue import (
    ROD_MM,
    Equipment,
    Order,
    ProtocolName,
    make_protocol,
    method_for,
)
from glovecal_models.sampling.engine import SHOWN_S, TIMER_S, Event, NotNow, Sampling, begin_sampling
from glovecal_models.sampling.guided.touch_watch import require_possible_touches
from glovecal_models.sampling.limits import SAMPLING_LIMITS
from glovecal_models.sampling.protocol import COUNTDOWN_S, SETTLE_S
from glovecal_models.sampling.sampled_takes import repeatability
from glovecal_models.sampling.shown_hands import shown_hands
from glovecal_models.sampling.state import SamplingState, Trigger
from glovecal_service.request_types import (
    IDENTIFIER,
    Channel,
    Identifier,
    StrictBody,
    SubjectName,
    WearingName,
)
from glovecal_service.rest.http.dependencies import StoreNeeded
from glovecal_service.rest.http.event_stream import looks
from glovecal_service.rest.http.list_part import ByTime
from glovecal_service.rest.http.problem import change_problems, problems
from glovecal_service.rest.http.request_types import IdInPath, SubjectFilter
from glovecal_service.rest.sampling.answer import Reused, SamplingView, StepDone, StepNow, TargetView
from glovecal_service.store.errors import Conflict
from glovecal_service.store.records import SamplingRecord
from glovecal_service.store.sampling_reuse import reuse_takes

router = APIRouter(prefix="/sampling", tags=["sampling"])

LOOK_EVERY_S = 0.1
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
    return _view(record)


@router.get("", response_model=list[SamplingView], summary="Samplings, newest first", responses=problems())
def list_samplings(
    store: StoreNeeded,
    paging: ByTime,
    glove: Annotated[str | None, Query(pattern=IDENTIFIER)] = None,
    subject: SubjectFilter = None,
    only_open: bool = False,
) -> list[SamplingView]:
    """Damaged rows are left out and named in `Warning` headers. More than `limit`: see `Link`."""
    page = store.samplings.page(paging.part, glove=glove, subject=subject, only_open=only_open)
    return [_view(record) for record in paging.answer(page)]


@router.get("/{id}", response_model=SamplingView, summary="One sampling", responses=problems())
def get_sampling(id: IdInPath, store: StoreNeeded) -> SamplingView:
    return _view(store.samplings.get(id))


@router.get(
    "/{id}/target",
    response_model=TargetView,
    summary="What the step at hand looks like, for viewers",
    responses=problems(),
)
def get_target(id: IdInPath, store: StoreNeeded) -> TargetView:
    """On the subject's own hand, so that fingertips which are to touch do so in the picture."""
    record = store.samplings.get(id)
    return _target(record, store.subjects.get(record.subject).skeleton())


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
            return _view(kept)
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
    shown = None
    async for record in looks(lambda: store.samplings.get(sampling.id), LOOK_EVERY_S):
        view = _view(record)
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


def _view(record: SamplingRecord) -> SamplingView:
    state = SamplingState.from_document(record.document)
    own = {name: getattr(record, name) for name in SamplingView.model_fields if hasattr(record, name)}
    return SamplingView(
        **own,
        protocol=state.protocol.name,
        method=method_for(state.protocol.name),
        trigger=state.trigger,
        seed=state.protocol.seed,
        phase=state.phase,
        phase_s=round(max(0.0, time.time() - state.since_s), 2),
        phase_of_s=_length(state),
        step=_step_now(state),
        steps=_steps(state),
        say=state.said,
        say_number=state.said_number,
        steadiness_percent=record.live.get("steadiness_percent"),
        still_percent=SAMPLING_LIMITS.still_percent,
        capture_s=round(state.capture_s, 2),
        capture_of_s=round(state.protocol.capture_s, 2),
        expected=state.expected,
        sentences=state.sentences,
        repeatability=repeatability(state),
    )


def _target(record: SamplingRecord, skeleton: Skeleton) -> TargetView:
    """What the step at hand looks like on the hand of ``skeleton``."""
    state = SamplingState.from_document(record.document)
    return TargetView(step=state.step, hands=shown_hands(state.now(), skeleton) if state.step else [])


def _length(state: SamplingState) -> float | None:
    if not state.step:
        return None
    lengths = {"countdown": COUNTDOWN_S, "settling": SETTLE_S, "recording": state.now().seconds}
    if state.trigger == "timer":
        lengths["waiting"] = TIMER_S
    if state.phase == "judged":
        return _shown_s(state)
    return lengths.get(state.phase)


def _shown_s(state: SamplingState) -> float | None:
    if state.attempts[-1].counts:
        return SHOWN_S
    return None if state.trigger == "key" else TIMER_S


def _step_now(state: SamplingState) -> StepNow | None:
    if not state.step:
        return None
    document: dict[str, Any] = state.now().to_document()
    names = [step.name for step in state.protocol.steps]
    return StepNow(**document, place=names.index(state.step) + 1)


def _steps(state: SamplingState) -> list[StepDone]:
    told = {attempt.step: attempt for attempt in state.attempts if not attempt.withdrawn} | state.finished()
    return [
        StepDone(
            name=step.name,
            kind=step.kind,
            outcome=told[step.name].outcome if step.name in told else "",
            reasons=list(told[step.name].reasons) if step.name in told else [],
        )
        for step in state.protocol.steps
    ]
