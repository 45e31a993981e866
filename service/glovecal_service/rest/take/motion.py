"""``motion``: takes as hands in motion, for other tools."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter
from fastapi.responses import FileResponse
from pydantic import Field, FiniteFloat
from starlette.background import BackgroundTask

from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import PALM
from glovecal_service.exports.formats import FORMATS, format_of
from glovecal_service.exports.hand_motion import Content, HandMotion, on_one_time
from glovecal_service.exports.take_motion import motion_of
from glovecal_service.rest.http.answers import change_problems
from glovecal_service.rest.http.dependencies import Parts, PartsNeeded
from glovecal_service.rest.http.request_types import ModelReference, StrictBody, TakeReference
from glovecal_service.store.errors import Conflict

router = APIRouter(prefix="/motion", tags=["takes"])

MOST_HANDS = 2
LARGEST_SHIFT_S = 1e9
Shift = Annotated[FiniteFloat, Field(ge=-LARGEST_SHIFT_S, le=LARGEST_SHIFT_S)]


class Motion(StrictBody):
    takes: Annotated[list[TakeReference], Field(min_length=1, max_length=MOST_HANDS)] = Field(
        description="Ids: one hand, or both hands, joined at the frames of the first."
    )
    models: Annotated[list[ModelReference | None], Field(max_length=MOST_HANDS)] = Field(
        default_factory=list,
        description="One a take; null: the model that is active for its subject and layout.",
    )
    content: Content = Field(
        "joints", description="joints: places in mm; angles: calibrated degrees; raw: readings."
    )
    format: Annotated[str, Field(pattern=r"^[a-z0-9]{1,16}$")] = Field(
        "trc", description=f"One of {', '.join(suffix[1:] for suffix in FORMATS)}."
    )
    shifts_s: Annotated[list[Shift], Field(max_length=MOST_HANDS)] = Field(
        default_factory=list,
        description="Added to each take's times, where two takes do not come from one capture computer.",
    )


@router.post(
    "",
    response_class=FileResponse,
    summary="Takes as motion files",
    responses=change_problems(409)
    | {
        200: {
            "description": "The file.",
            "content": {
                one.media_type: {"schema": {"type": "string", "format": "binary"}} for one in FORMATS.values()
            },
        }
    },
)
def export_motion(body: Motion, parts: PartsNeeded) -> FileResponse:
    """Calibrated by the model that is named, else by the active one; effects with a memory start in the
    pre-roll. 409 where angles are asked for and no model is active.
    """
    chosen = format_of(f"motion.{body.format}")
    for name, given in (("models", body.models), ("shifts_s", body.shifts_s)):
        if given and len(given) != len(body.takes):
            raise BadInput(f"{len(given)} {name} for {len(body.takes)} takes: give one a take, or none")
    models = body.models or [None] * len(body.takes)
    hands = [_hand(parts, take, model, body.content) for take, model in zip(body.takes, models, strict=True)]
    labels = [one.label for one in hands]
    if len(set(labels)) < len(labels):
        raise BadInput("both takes are of the same hand; one of the two subjects has the other hand")
    hands = on_one_time(hands, body.shifts_s)
    folder = tempfile.TemporaryDirectory(prefix="glovecal-motion-")
    try:
        path = Path(folder.name, f"motion{chosen.suffix}")
        chosen.write(hands, body.content, path)
    except BaseException:
        folder.cleanup()
        raise
    return FileResponse(
        path, media_type=chosen.media_type, filename=path.name, background=BackgroundTask(folder.cleanup)
    )


def _hand(parts: Parts, take: str, model: str | None, content: Content) -> HandMotion:
    record = parts.store.takes.get(take)
    subject = parts.store.subjects.get(record.subject)
    found = None
    if content != "raw":
        chosen = (
            parts.store.models.active(record.subject, record.layout)
            if model is None
            else parts.store.models.get(model)
        )
        if chosen is None:
            raise Conflict(
                f"no model of {record.subject} with layout {record.layout} is active: name a model, or ask "
                "for raw readings"
            )
        found, _ = parts.predictors.get(chosen.id)
    label = "L" if subject.hand == "left" else "R"
    arches = found is not None and found.method == "template" and PALM in found.rotation_names
    skeleton = subject.skeleton(palm="arching" if arches else "rigid")
    return motion_of(parts.store.takes.load(record.id), found, skeleton, label)
