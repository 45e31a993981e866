"""``motion``: takes as hands in motion, for other tools."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path, PurePosixPath
from typing import Annotated

from fastapi import APIRouter, Request
from fastapi.responses import FileResponse
from pydantic import Field, FiniteFloat
from starlette.background import BackgroundTask

from glovecal_client.operating_system import name_for_a_file
from glovecal_models.errors import BadInput
from glovecal_models.hand.retargeting.robot_description import KINDS
from glovecal_models.hand.rotations import Handedness
from glovecal_models.progress import Cancel
from glovecal_service.exports.body_markers import Wrist
from glovecal_service.exports.character_files import SUFFIXES as CHARACTERS
from glovecal_service.exports.formats import FORMATS, format_of
from glovecal_service.exports.hand_motion import Content
from glovecal_service.exports.motion_file import Body as BodyFile
from glovecal_service.exports.motion_file import HandTake, MotionFile, fits, write_motion
from glovecal_service.exports.onto import is_robot
from glovecal_service.exports.resampling import Resampling
from glovecal_service.exports.robot_motion import SUFFIXES
from glovecal_service.request_types import ModelReference, StrictBody, TakeReference, Title
from glovecal_service.rest.http.dependencies import Parts, PartsNeeded
from glovecal_service.rest.http.list_part import InParts
from glovecal_service.rest.http.long_answers import in_process, in_time
from glovecal_service.rest.http.problem import change_problems, problems
from glovecal_service.rest.http.temporary_folder import temporary_folder
from glovecal_service.rest.take.answer import CharacterHand, MotionFormat
from glovecal_service.store.errors import Conflict, NotFound

router = APIRouter(prefix="/motion", tags=["takes"])

MOST_HANDS = 2
LARGEST_SHIFT_S = 1e9
FASTEST_HZ = 1000.0
LIMIT_S = 1800.0
"""An hour of one hand took 4 minutes on two loaded cores."""
LONGEST_NAME = 50
"""Characters of a file's name, four bytes each at most."""
MOST_BONES, SHA256_LENGTH = 64, 64
BoneName = Annotated[str, Field(pattern=r"^[a-z_.]{1,40}$")]
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
    hands: Annotated[list[Handedness | None], Field(max_length=MOST_HANDS)] = Field(
        default_factory=list,
        description="One a take; null, or not given: as its capture said, or else as its subject has it.",
    )
    content: Content = Field(
        "joints", description="joints: places in mm; angles: calibrated degrees; raw: readings."
    )
    measured: bool = Field(
        False, description="The angles that were measured (the takes' reference), not those of a model."
    )
    offline: bool = Field(
        False,
        description="The model's angles are estimated with both directions of time, not as they were live.",
    )
    rate_hz: Annotated[FiniteFloat, Field(gt=0, le=FASTEST_HZ)] | None = Field(
        None, description="Frames on even steps of this rate; null: at the frames' own times."
    )
    low_pass_hz: Annotated[FiniteFloat, Field(gt=0, le=FASTEST_HZ)] | None = Field(
        None,
        description="Angles without what is faster: a Butterworth filter forward and backward, which delays "
        "nothing; frames then stand on even steps.",
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
    onto: Annotated[str, Field(pattern=r"^([0-9a-f]{64}|[a-z]{1,16})$")] | None = Field(
        None,
        description=f"A character ({', '.join(CHARACTERS)}) sent to `uploads`, whose skeleton moves, found "
        f"by the names of its bones: in the format that it has. Or a robot's hand, {', '.join(KINDS)} or "
        "its URDF sent to `uploads`: angles of its joints, format "
        f"{', '.join(suffix[1:] for suffix in SUFFIXES)}.",
    )
    bones: dict[BoneName, Annotated[str, Field(max_length=200)]] = Field(
        default_factory=dict,
        max_length=MOST_BONES,
        description="The character's bone, or the robot's link, by the hand's bone (`index_proximal`, or "
        "`left.index_proximal` for one hand), where another is meant than is found; empty: none.",
    )


@router.get("", summary="Formats of motion files", responses=problems())
def list_formats(paging: InParts) -> list[MotionFormat]:
    """What each holds, and how: units, axes, times, standard deviations."""
    formats = [
        MotionFormat(
            format=one.suffix.removeprefix("."),
            name=one.name,
            contents=list(one.contents),
            unit=one.unit,
            axes=one.axes,
            times=one.times,
            accuracy=one.accuracy,
            read_by=one.read_by,
            characters=one.suffix in CHARACTERS,
            robots=list(KINDS) if one.suffix in SUFFIXES else [],
        )
        for one in FORMATS.values()
    ]
    return paging.part_of(formats, lambda one: one.format)


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
async def export_motion(body: Motion, request: Request, parts: PartsNeeded) -> FileResponse:
    """Calibrated by the model that is named, else by the active one; effects with a memory start in the
    pre-roll. 409 where angles are asked for and no model is active, or nobody said which hand it is.
    """
    folder = temporary_folder()
    try:
        chosen = format_of(f"motion.{body.format}")
        name = PurePosixPath(body.file_name).name.removesuffix(chosen.suffix)[:LONGEST_NAME] or "motion"
        path = Path(folder.name, name_for_a_file(name + chosen.suffix))

        def write(cancelled: Cancel) -> None:
            with _asked(parts, body, path) as asked:
                if asked.is_short:
                    write_motion(asked)
                else:
                    in_process(write_motion, asked, "the export", cancelled)

        await in_time(request, parts, write, limit_s=LIMIT_S, what="this export")
    except BaseException:
        folder.cleanup()
        raise
    return FileResponse(
        path, media_type=chosen.media_type, filename=path.name, background=BackgroundTask(folder.cleanup)
    )


@router.post(
    "/character", summary="How well a character or a robot shows a motion", responses=change_problems(409)
)
async def look_at_character(body: Motion, request: Request, parts: PartsNeeded) -> list[CharacterHand]:
    """Which of its bones is which of the hand's, how far its fingertips are from the hand's, and which
    touches are lost, for each hand of a motion that names one (`onto`)."""
    if body.onto is None:
        raise BadInput(
            "neither a character nor a robot is named; send its file to /v1/uploads and name it in onto, or "
            f"one of {', '.join(KINDS)}"
        )
    answer: list[CharacterHand] = []

    def look(cancelled: Cancel) -> None:
        with _asked(parts, body, Path(f"motion.{body.format}")) as asked:
            seen = fits(asked)
        answer.extend(
            CharacterHand.model_validate(
                {**vars(one), "missing": list(one.missing), "choices": list(one.choices)}
            )
            for one in seen
        )

    await in_time(request, parts, look, limit_s=LIMIT_S, what="this look")
    return answer


@contextmanager
def _asked(parts: Parts, body: Motion, path: Path) -> Iterator[MotionFile]:
    """While the uploads that it needs can be read."""
    with ExitStack() as held:
        yield _motion_file(parts, body, path, held)


def _motion_file(parts: Parts, body: Motion, path: Path, held: ExitStack) -> MotionFile:
    for name, given in (("models", body.models), ("hands", body.hands), ("shifts_s", body.shifts_s)):
        if given and len(given) != len(body.takes):
            raise BadInput(f"{len(given)} {name} for {len(body.takes)} takes: give one a take, or none")
    models = body.models or [None] * len(body.takes)
    sides = body.hands or [None] * len(body.takes)
    asked = zip(body.takes, models, sides, strict=True)
    hands = [_hand(parts, body, take, model, side) for take, model, side in asked]
    markers = None
    if body.body is not None:
        file = parts.uploads.find(body.body.upload)
        if file is None:
            raise NotFound(f"no upload {body.body.upload[:12]}; send the TRC file to /v1/uploads first")
        [file] = held.enter_context(parts.uploads.under_names((file.name, file)))
        markers = BodyFile(file, body.body.shift_s, tuple(body.body.right), tuple(body.body.left))
    onto: Path | str | None = body.onto
    if body.onto is not None and len(body.onto) == SHA256_LENGTH:
        onto = parts.uploads.find(body.onto)
        if onto is None:
            raise NotFound(f"no upload {body.onto[:12]}; send the character's or robot's file first")
        [onto] = held.enter_context(parts.uploads.under_names((onto.name, onto)))
    content = "angles" if onto is not None and is_robot(onto) else body.content
    resampling = Resampling(body.rate_hz, body.low_pass_hz)
    return MotionFile(
        tuple(hands),
        content,
        path,
        tuple(body.shifts_s),
        body.claps,
        body.wrist,
        markers,
        resampling,
        onto,
        body.bones,
    )


def _hand(parts: Parts, body: Motion, take: str, model: str | None, hand: Handedness | None) -> HandTake:
    """``hand`` counts where it is given, then what capture said of the glove, then the subject's."""
    record = parts.store.takes.get(take)
    subject = parts.store.subjects.get(record.subject)
    side = hand or record.known_hand or subject.known_hand
    artifact = chosen = None
    if body.offline and (body.content == "raw" or body.measured):
        raise BadInput("only a model's angles are estimated offline; ask for them, or leave offline out")
    if body.content != "raw" and not body.measured:
        chosen = (
            parts.store.models.active(record.subject, record.layout, hand or record.known_hand)
            if model is None
            else parts.store.models.get(model)
        )
        if chosen is None:
            raise Conflict(
                f"no model of {record.subject} with layout {record.layout} is active: name a model, or ask "
                "for measured angles or raw readings"
            )
        artifact = parts.store.models.load_bytes(chosen.id)
    if side is None:
        raise Conflict(
            f"nobody said which hand take {record.name} is of: name it with --hand left or --hand right, or "
            f"say it of the subject: glovecal subject measure {record.subject} --hand left"
        )
    recorded, measured = parts.store.takes.load_recorded(record.id), body.measured and body.content != "raw"
    return HandTake(
        recorded,
        subject,
        side,
        artifact,
        chosen.id if chosen else None,
        measured,
        record.accounting,
        record.time_code,
        body.offline,
    )
