"""``cameras``: cameras before a colour glove, whose poses are published like any glove's."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query, Response
from pydantic import Field, ValidationError

from glovecal_client.errors import BadName, NoAnswer, QueryRefused
from glovecal_client.keys import GloveKeys, all_gloves, parse_glove_key
from glovecal_client.session import json_object
from glovecal_service.camera.camera_settings import CameraFiles, CameraSettings
from glovecal_service.camera.started_cameras import StartedCamera
from glovecal_service.request_types import Identifier, StrictBody, SubjectName
from glovecal_service.rest.glove.answer import CameraHealthView, CameraView, Kept, Stage
from glovecal_service.rest.http.dependencies import Parts, PartsNeeded
from glovecal_service.rest.http.list_part import InParts
from glovecal_service.rest.http.problem import change_problems, problems
from glovecal_service.rest.http.request_types import NameInPath
from glovecal_service.store.errors import Conflict, NotFound

router = APIRouter(prefix="/cameras", tags=["cameras"])

Source = Annotated[str, Field(pattern=r"^(camera:[0-9]{1,2}|rendered|video:[a-z0-9][a-z0-9_-]{0,63})$")]


BALANCED_WITHIN_S = 60.0
MOST_ENTRIES = 100_000
"""As many as in the paper; more are built on a command line."""


class NewCamera(StrictBody):
    glove: Identifier
    source: Source = Field(
        description="camera:0 is the first; video:NAME plays an imported video at its own pace; rendered "
        "draws a moving glove, to try."
    )
    stage: Stage = "dense"
    keep: Kept = Field("labels", description="pictures: as they came (FFV1); labels: of those tracked.")
    colours: Identifier | None = Field(
        None, description="Colour table, as `camera-files` has it. Null: learned on rendered photographs."
    )
    calibration: Identifier | None = Field(
        None, description="Of the camera, as `camera-files` has it. Null: focal length and lens are assumed."
    )
    subject: SubjectName | None = Field(
        None, description="Whose hand it is: with its sizes where they were measured."
    )
    hand: Literal["right", "left"] | None = Field(
        None, description="Null: the subject's, else the right one."
    )
    mirrored: bool = Field(
        False, description="Left and right of the pictures are exchanged, as a preview's often are."
    )
    entries: Annotated[int, Field(ge=300, le=MOST_ENTRIES)] = Field(
        20_000, description="Of the pose database: 18 kB each on disk, a minute for 20,000."
    )


class NewStage(StrictBody):
    stage: Stage


@router.post(
    "", status_code=201, response_model=CameraView, summary="Start a camera", responses=change_problems(409)
)
def start_camera(body: NewCamera, parts: PartsNeeded) -> CameraView:
    """Answers at once; ``state`` tells how far it is. The first time it builds the pose database, which takes
    half a minute. 404 for a colour table, calibration or video that is not kept; 409 where that glove is
    published already, or too many cameras are on."""
    settings = parts.settings
    known = _cameras(parts)
    if body.glove in known and known[body.glove].state != "stopped":
        raise Conflict(f"a camera publishes glove {body.glove} already; stop it first")
    files = CameraFiles(settings.data / "cameras")
    worn_by = None if body.subject is None else parts.store.subjects.get(body.subject)
    kind, _, name = body.source.partition(":")
    source = f"video:{files.video(name).file}" if kind == "video" else body.source
    asked = CameraSettings(
        source, body.glove, settings.site, settings.zenoh, body.subject, body.keep,
        data=settings.data, hand=body.hand or (worn_by and worn_by.known_hand) or "right",
        stage=body.stage,
        colours=None if body.colours is None else files.path("colours", body.colours),
        calibration=None if body.calibration is None else files.path("calibrations", body.calibration),
        mirrored=body.mirrored, entries=body.entries,
        sizes_mm={} if worn_by is None else worn_by.dimensions,
    )  # fmt: skip
    return _silent(parts.cameras.started.start(asked))


@router.get("", response_model=list[CameraView], summary="Cameras", responses=problems())
def list_cameras(parts: PartsNeeded, paging: InParts) -> list[CameraView]:
    """Those that answer, wherever they were started, and those that this service started and that ended."""
    return paging.part_of((view for _, view in sorted(_cameras(parts).items())), lambda view: view.glove)


@router.get("/{glove}", response_model=CameraView, summary="One camera", responses=problems())
def get_camera(glove: NameInPath, parts: PartsNeeded) -> CameraView:
    return _camera(parts, glove)


@router.post("/{glove}/stop", response_model=CameraView, summary="Stop a camera", responses=change_problems())
def stop_camera(glove: NameInPath, parts: PartsNeeded) -> CameraView:
    """Also one that was started on a command line."""
    camera = _camera(parts, glove)
    ended = parts.cameras.started.stop(glove)
    if ended is not None:
        return _silent(ended)
    _command(parts, glove, "stop", "")
    return camera.model_copy(update={"state": "stopped", "sentence": "stopped", "health": None})


@router.put(
    "/{glove}/stage", response_model=CameraView, summary="Choose the stage", responses=change_problems(409)
)
def choose_stage(glove: NameInPath, body: NewStage, parts: PartsNeeded) -> CameraView:
    """From the next picture on. 409 while the camera is not ready."""
    _camera(parts, glove)
    _command(parts, glove, "stage", body.stage)
    return _camera(parts, glove)


@router.post(
    "/{glove}/balance",
    response_model=CameraView,
    summary="Balance the colours",
    responses=change_problems(409),
)
def balance_colours(glove: NameInPath, parts: PartsNeeded) -> CameraView:
    """Gains of red and blue are searched for with which the last pictures come nearest to the database: for
    light that the colours were not learned in. A hand in the glove has to be in view. 409 where it is not."""
    _camera(parts, glove)
    _command(parts, glove, "balance", "", timeout_s=BALANCED_WITHIN_S)
    return _camera(parts, glove)


@router.get(
    "/{glove}/picture",
    summary="The newest picture",
    responses=problems(409) | {200: {"content": {"image/jpeg": {}}}},
    response_class=Response,
)
def get_picture(
    glove: NameInPath,
    parts: PartsNeeded,
    layers: Annotated[
        str,
        Query(
            pattern=r"^((picture|labels|model)(,(picture|labels|model)){0,2})?$",
            description="picture, labels, model, with commas; empty: all.",
        ),
    ] = "",
    width: Annotated[int, Query(ge=16, le=1920)] = 640,
) -> Response:
    """A JPEG of the picture tracked last, with its labels and the model that was found drawn over. What was
    drawn, not seen by a camera, says so in the picture. 409 before the first."""
    try:
        key = GloveKeys(parts.settings.site, glove).picture
        (sample, *_) = parts.cameras.ask(f"{key}?layers={layers};width={width}")
    except QueryRefused as refused:
        raise Conflict(str(refused).partition(": ")[2]) from refused
    except (NoAnswer, BadName) as error:
        raise NotFound(
            f"no camera of glove {glove} answers; start it: glovecal camera track SOURCE --glove {glove}"
        ) from error
    return Response(sample.payload.to_bytes(), media_type="image/jpeg", headers={"Cache-Control": "no-store"})


def _cameras(parts: Parts) -> dict[str, CameraView]:
    started = parts.cameras.started.states()
    found = {glove: _silent(camera) for glove, camera in started.items()}
    try:
        samples = parts.cameras.ask(all_gloves(parts.settings.site, "status"))
    except NoAnswer:
        return found
    for sample in samples:
        try:
            glove = parse_glove_key(str(sample.key_expr))[0].glove
        except BadName:
            continue
        status = json_object(sample.payload.to_bytes()) or {}
        view = said_of_itself(glove, status, started_here=glove in started and started[glove].is_on)
        if view is not None:
            found[glove] = view
    return found


def said_of_itself(glove: str, status: Mapping[str, Any], *, started_here: bool) -> CameraView | None:
    """None for what is no camera's status."""
    if not isinstance(status.get("camera"), dict):
        return None
    try:
        health = CameraHealthView.model_validate(status["camera"])
        published = {name: status.get(name) for name in ("state", "sentence")}
        own = {"glove": glove, "source": health.source, "is_simulated": health.simulated, "health": health}
        return CameraView.model_validate(published | own | {"started_here": started_here})
    except ValidationError:
        return None


def _silent(camera: StartedCamera) -> CameraView:
    """One that was started here and does not answer: it begins, or has ended."""
    return CameraView(
        glove=camera.glove, source=camera.source, state="opening" if camera.is_on else "stopped",
        sentence=camera.sentence or ("starting" if camera.is_on else "stopped"),
        is_simulated=camera.source == "rendered", started_here=True, health=None,
    )  # fmt: skip


def _camera(parts: Parts, glove: str) -> CameraView:
    found = _cameras(parts).get(glove)
    if found is None:
        raise NotFound(f"no camera of glove {glove}; start it: glovecal camera track SOURCE --glove {glove}")
    return found


def _command(parts: Parts, glove: str, name: str, argument: str, *, timeout_s: float = 2.0) -> None:
    key = GloveKeys(parts.settings.site, glove).control
    try:
        parts.cameras.ask(f"{key}?do={name};with={argument}", timeout_s=timeout_s)
    except QueryRefused as refused:
        raise Conflict(str(refused).partition(": ")[2]) from refused
    except NoAnswer as error:
        raise NotFound(f"the camera of glove {glove} does not answer") from error
