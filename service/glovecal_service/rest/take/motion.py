"""``motion``: takes as hands in motion, for other tools."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Annotated

from fastapi import APIRouter
from fastapi.responses import FileResponse
from pydantic import Field, FiniteFloat
from starlette.background import BackgroundTask

from glovecal_client.operating_system import name_for_a_file
from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import PALM
from glovecal_models.takes.common_event import common_events
from glovecal_service.exports.body_markers import Wrist, hand_frame, read_trc
from glovecal_service.exports.formats import FORMATS, format_of
from glovecal_service.exports.hand_motion import Content, HandMotion, on_one_time
from glovecal_service.exports.take_motion import motion_of
from glovecal_service.rest.http.answers import change_problems
from glovecal_service.rest.http.dependencies import Parts, PartsNeeded
from glovecal_service.rest.http.request_types import ModelReference, StrictBody, TakeReference, Title
from glovecal_service.rest.take.hands import hand_alignment
from glovecal_service.store.errors import Conflict, NotFound

router = APIRouter(prefix="/motion", tags=["takes"])

MOST_HANDS = 2
LARGEST_SHIFT_S = 1e9
CLAPS_WITHIN_S = 5.0
LONGEST_NAME = 50
"""Characters of a file's name, four bytes each at most."""
MarkerNames = Annotated[list[Annotated[str, Field(min_length=1, max_length=64)]], Field(max_length=4)]
Shift = Annotated[FiniteFloat, Field(ge=-LARGEST_SHIFT_S, le=LARGEST_SHIFT_S)]


class Body(StrictBody):
    upload: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")] = Field(
        description="A TRC file sent to `uploads`, in mm, cm or m."
    )
    shift_s: Shift | None = Field(
        None, description="Added to its times; null: both begin at once. Claps refine it within 5 s."
    )
    right: MarkerNames = Field(default_factory=list, description="Markers that place the right hand.")
    left: MarkerNames = Field(
        default_factory=list,
        description="wrist=glove: wrist at the thumb's and at the little finger's side, elbow; "
        "wrist=optical: both of the wrist, then both of the back of the hand.",
    )


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
    file_name: Annotated[Title, Field(min_length=1)] = Field(
        "motion", description="That the file is to have; TRC names itself in its first line."
    )
    shifts_s: Annotated[list[Shift], Field(max_length=MOST_HANDS)] = Field(
        default_factory=list,
        description="Added to each take's times. Not given: two takes are joined as `takes/hands` says.",
    )
    claps: bool = Field(False, description="Join two takes, and the body, by claps that all of them felt.")
    wrist: Wrist = Field("glove", description="optical: the glove's wrist angles are ignored.")
    body: Body | None = Field(
        None, description="Markers of an optical system, joined to the joints in a TRC."
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
    if len(hands) == MOST_HANDS and not body.shifts_s:
        found, _ = hand_alignment(parts.store, body.takes[0], body.takes[1], claps=body.claps)
        hands[1] = replace(hands[1], time_s=found.onto_first(hands[1].time_s))
    hands = on_one_time(hands, body.shifts_s)
    if body.wrist == "optical":
        hands = [replace(one, wrist="optical") for one in hands]
    if body.body is not None:
        if (body.content, body.format) != ("joints", "trc"):
            raise BadInput("markers of a body are joined to joints in a TRC file: content joints, format trc")
        hands = _with_body(parts, body, body.body, hands)
    folder = tempfile.TemporaryDirectory(prefix="glovecal-motion-")
    try:
        name = PurePosixPath(body.file_name).name.removesuffix(chosen.suffix)[:LONGEST_NAME] or "motion"
        path = Path(folder.name, name_for_a_file(name + chosen.suffix))
        chosen.write(hands, body.content, path)
    except BaseException:
        folder.cleanup()
        raise
    return FileResponse(
        path, media_type=chosen.media_type, filename=path.name, background=BackgroundTask(folder.cleanup)
    )


def _with_body(parts: Parts, asked: Motion, body: Body, hands: Sequence[HandMotion]) -> list[HandMotion]:
    """Hands placed by the body's markers where those are named, and the markers beside the first."""
    path = parts.uploads.find(body.upload)
    if path is None:
        raise NotFound(f"no upload {body.upload[:12]}; send the TRC file to /v1/uploads first")
    found = read_trc(path, "the body's file")
    shift_s = float(hands[0].time_s[0] - found.time_s[0]) if body.shift_s is None else body.shift_s
    if asked.claps:
        take = parts.store.takes.load(asked.takes[0])
        moved = replace(found, time_s=found.time_s + shift_s).as_take()
        shift_s += common_events(take, moved, CLAPS_WITHIN_S).shift_s
    at = replace(found, time_s=found.time_s + shift_s).at(hands[0].time_s)
    placed = []
    for hand in hands:
        names = body.left if hand.label == "L" else body.right
        frame = hand_frame(at, names, asked.wrist, is_left=hand.label == "L") if names else None
        placed.append(replace(hand, frame=frame))
    return [replace(placed[0], beside=at), *placed[1:]]


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
