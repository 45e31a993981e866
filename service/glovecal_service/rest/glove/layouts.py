"""``gloves``: layouts (what kinds of glove there are) and the gloves that were seen on the network."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Request, Response
from fastapi.exceptions import RequestValidationError
from pydantic import Field, FiniteFloat, StringConstraints, ValidationError
from starlette.concurrency import run_in_threadpool

from glovecal_client.keys import GloveKeys
from glovecal_models.documents import read_toml
from glovecal_models.errors import BadInput, BadLayout
from glovecal_models.layout import MOST_NAMES, Layout
from glovecal_service.questions.people import prior_of_people
from glovecal_service.request_types import (
    ONE_LINE,
    Channel,
    Identifier,
    StrictBody,
    SubjectName,
    Title,
    WearingName,
)
from glovecal_service.rest.glove.answer import Delay, Gloves, GloveView, Latency, LayoutView
from glovecal_service.rest.glove.live import has_publisher
from glovecal_service.rest.http.dependencies import PartsNeeded, StoreNeeded
from glovecal_service.rest.http.problem import Problem, change_problems, problems
from glovecal_service.rest.http.request_types import NameInPath
from glovecal_service.store.database import now
from glovecal_service.store.errors import Conflict
from glovecal_service.store.layouts import no_layout
from glovecal_service.store.records import GloveRecord, LayoutRecord

router = APIRouter(prefix="/gloves", tags=["gloves"])

MOST_CHANNELS = MOST_NAMES
Channels = Annotated[list[Channel], Field(max_length=MOST_CHANNELS)]
Expression = Annotated[str, StringConstraints(max_length=2000, pattern=ONE_LINE)]


class LayoutBody(StrictBody):
    """A layout file: TOML and JSON have the same keys."""

    name: Identifier | None = Field(None, description="None: as in the path.")
    title: Title = ""
    sensors: Annotated[list[Channel], Field(min_length=1, max_length=MOST_CHANNELS)]
    rotations: Annotated[dict[Channel, Channels], Field(max_length=MOST_CHANNELS)] = Field(
        {}, description="Rotation: the sensors it is read from."
    )
    simulated: Annotated[dict[Channel, Expression], Field(max_length=MOST_CHANNELS)] = Field(
        {}, description="Rotation without a sensor: an expression of sensors, such as `2/3 * I_PIP`."
    )
    palm: Channels = Field(default_factory=list)
    context: Channels = Field(default_factory=list)
    counts: Annotated[list[FiniteFloat], Field(min_length=2, max_length=2)] | None = None
    order: Channels | None = None
    also: Channels | None = None


class Wearer(StrictBody):
    subject: SubjectName | None = Field(description="None: nobody.")
    wearing: WearingName | None = None


@router.get("", response_model=Gloves, summary="Layouts, and gloves seen", responses=problems())
def list_gloves(store: StoreNeeded) -> Gloves:
    seen = [GloveView.model_validate(record, from_attributes=True) for record in store.gloves.list()]
    return Gloves(layouts=[_view(record) for record in store.layouts.list()], seen=seen)


@router.get("/{layout}", response_model=LayoutView, summary="One layout", responses=problems())
def get_layout(layout: NameInPath, store: StoreNeeded) -> LayoutView:
    every = store.layouts.list()
    for record in every:
        if record.name == layout:
            return _view(record)
    raise no_layout(layout, (record.name for record in every))


@router.get(
    "/{layout}/people",
    response_model=dict[str, Any],
    summary="The people of a layout as a prior for somebody new",
    responses=problems(),
)
def get_people(layout: NameInPath, store: StoreNeeded) -> dict[str, Any]:
    """Means and variances of what their takes with a reference say; no reading, angle or name of anybody."""
    return prior_of_people(store, layout).to_document()


@router.put(
    "/{layout}",
    response_model=LayoutView,
    summary="Store a layout, TOML or JSON",
    responses=change_problems(409, 415),
    openapi_extra={
        "requestBody": {
            "required": True,
            "content": {
                "application/json": {"schema": {"$ref": "#/components/schemas/LayoutBody"}},
                "application/toml": {"schema": {"type": "string"}},
            },
        }
    },
)
async def put_layout(layout: NameInPath, request: Request, store: StoreNeeded) -> LayoutView:
    """The name inside must be the name in the path. 409 when a different layout of the name is in use."""
    body = _checked(await request.body(), request.headers.get("content-type", ""))
    if body.name not in (None, layout):
        raise Problem(422, "bad-layout", f"the path names layout {layout!r}, the body {body.name!r}")
    parsed = Layout.from_document(body.model_dump(exclude_none=True) | {"name": layout})
    return _view(await run_in_threadpool(store.layouts.put, parsed))


@router.put(
    "/{glove}/wearer",
    response_model=GloveView,
    summary="Say who wears a glove",
    responses=change_problems(),
)
def set_wearer(glove: NameInPath, body: Wearer, store: StoreNeeded) -> GloveRecord:
    """The live stream is predicted by that subject's active model from then on."""
    return store.gloves.assign(glove, body.subject, body.wearing)


@router.delete(
    "/{glove}",
    status_code=204,
    response_class=Response,
    summary="Forget a glove that was seen",
    responses=change_problems(409),
)
def forget_glove(glove: NameInPath, store: StoreNeeded, parts: PartsNeeded) -> None:
    """With who wears it and its latency; takes and recordings stay. 409 while it streams or is recorded. It
    is stored again with its next frame."""
    store.gloves.get(glove)
    if has_publisher(parts.settings.zenoh, GloveKeys(parts.settings.site, glove)):
        raise Conflict(f"glove {glove!r} streams; stop its capture first, then remove it")
    store.gloves.remove(glove)


@router.put(
    "/{glove}/latency",
    response_model=GloveView,
    summary="Keep how late a glove is",
    responses=change_problems(),
)
def set_latency(glove: NameInPath, body: Latency, store: StoreNeeded) -> GloveRecord:
    """It is taken off the time of live poses and added to their age; a diagnosis tells clocks from it."""
    return store.gloves.set_latency(glove, body.model_dump() | {"measured_at": now().isoformat()})


@router.delete(
    "/{glove}/latency",
    response_model=GloveView,
    summary="Forget how late a glove is",
    responses=change_problems(),
)
def forget_latency(glove: NameInPath, store: StoreNeeded) -> GloveRecord:
    store.gloves.get(glove)
    return store.gloves.set_latency(glove, None)


@router.put(
    "/{glove}/delay",
    response_model=GloveView,
    summary="Have a glove's live poses wait for the frames after them",
    responses=change_problems(),
)
def set_delay(glove: NameInPath, body: Delay, store: StoreNeeded) -> GloveRecord:
    """Then they are estimated with what came up to `delay_ms` after each frame, as recordings are with all.
    A pose has the time of its frame, its age holds the delay, and `pose/meta` says it."""
    return store.gloves.set_delay(glove, body.delay_ms)


def _view(record: LayoutRecord) -> LayoutView:
    layout = Layout.built_in(record.name) if record.built_in else Layout.from_document(record.document)
    return LayoutView(
        **vars(record), title=layout.title, sensors=list(layout.sensors), rotations=list(layout.rotations)
    )


def _checked(content: bytes, content_type: str) -> LayoutBody:
    kind = content_type.partition(";")[0].strip().lower()
    if kind not in ("application/json", "application/toml"):
        raise Problem(
            415, "media-type", f"send application/toml or application/json, not {kind or 'nothing'}"
        )
    try:
        if kind == "application/json":
            return LayoutBody.model_validate_json(content)
        return LayoutBody.model_validate(read_toml(content, "layout"))
    except ValidationError as error:
        found = error.errors(include_url=False)
        raise RequestValidationError([{**item, "loc": ("body", *item["loc"])} for item in found]) from error
    except BadInput as error:
        raise BadLayout(str(error)) from error
