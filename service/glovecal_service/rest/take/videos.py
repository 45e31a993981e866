"""``videos``: what was filmed beside takes, picture by picture, and a model's hand at the same moments."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
from fastapi import APIRouter, Query, Response
from fastapi import Path as InPath
from pydantic import Field

from glovecal_client.pictures.video_file import MOST_PICTURES
from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import completed
from glovecal_service.exports.hand_motion import at_times
from glovecal_service.exports.motion_file import motion_of
from glovecal_service.plain import plain
from glovecal_service.request_types import SHA256_PREFIX, Sha256, StrictBody
from glovecal_service.rest.http.dependencies import Parts, PartsNeeded
from glovecal_service.rest.http.list_part import InParts
from glovecal_service.rest.http.problem import change_problems, problems
from glovecal_service.rest.http.request_types import IdInPath, SubjectFilter
from glovecal_service.rest.take.answer import HandBeside, Video
from glovecal_service.store.errors import Conflict, NotFound
from glovecal_service.store.records import TakeRecord
from glovecal_service.store.take_file import VideoFacts, check_preview

router = APIRouter(prefix="/videos", tags=["takes"])

ALWAYS_THE_SAME = "private, max-age=3600"


class Attached(StrictBody):
    upload: Sha256 = Field(description="A preview sent to `uploads`, as `glovecal record --video` makes it.")


@router.get("", response_model=list[Video], summary="Takes with a video", responses=problems())
def list_videos(parts: PartsNeeded, paging: InParts, subject: SubjectFilter = None) -> list[Video]:
    """Newest takes first; a damaged file is left out here and named when it is asked for. More than `limit`:
    see `Link`."""
    part = replace(paging.part, reverse=True)
    found = []
    for row in paging.answer(parts.store.takes.page(part, subject=subject, among=parts.videos.takes())):
        with suppress(BadInput):
            found.append(_video(row, parts.videos.facts(row.id)))
    return found


@router.put("/{id}", response_model=Video, summary="Attach a video", responses=change_problems(409))
def put_video(id: IdInPath, body: Attached, parts: PartsNeeded) -> Video:
    """409 for a video of another computer's clock, or of another time than the take's."""
    take = parts.store.takes.get(id)
    upload = parts.uploads.find(body.upload)
    if upload is None:
        raise NotFound(f"no upload {body.upload[:12]}; send the preview to /v1/uploads first")
    return attach_preview(parts, take, upload)


def _video(take: TakeRecord, facts: VideoFacts) -> Video:
    drawn = "drawn" if facts.simulated else f"of {facts.source}"
    seconds = facts.times_s[-1] - facts.times_s[0]
    return Video(
        take=take.id, name=take.name, source=facts.source, simulated=facts.simulated,
        times_s=facts.times_s, sentence=f"{len(facts.times_s)} pictures {drawn}, {seconds:.1f} s.",
    )  # fmt: skip


def attach_preview(parts: Parts, take: TakeRecord, preview: Path) -> Video:
    """Show ``preview`` beside a take from now on. Raises BadInput, Conflict."""
    facts = check_preview(preview)
    computer = (take.accounting or {}).get("computer")
    if computer != facts.computer:
        raise Conflict(
            f"take {take.name!r} was captured by another computer's clock, or before it restarted: the "
            "video's times mean nothing there. Film on the computer that captures."
        )
    time_s = parts.store.takes.load_recorded(take.id).time_s
    if facts.times_s[-1] < time_s[0] or facts.times_s[0] > time_s[-1]:
        raise Conflict(
            f"the video lasts from {facts.times_s[0]:.1f} to {facts.times_s[-1]:.1f} s and take "
            f"{take.name!r} from {time_s[0]:.1f} to {time_s[-1]:.1f} s: no moment in common"
        )
    parts.videos.attach(take.id, preview)
    return _video(take, facts)


@router.get("/{id}", response_model=Video, summary="A take's video", responses=problems())
def get_video(id: IdInPath, parts: PartsNeeded) -> Video:
    return _video(parts.store.takes.get(id), parts.videos.facts(id))


@router.get(
    "/{id}/pictures/{number}",
    response_class=Response,
    summary="One picture",
    responses={200: {"content": {"image/jpeg": {}}}, **problems()},
)
def get_picture(
    id: IdInPath, number: Annotated[int, InPath(ge=0, lt=MOST_PICTURES)], parts: PartsNeeded
) -> Response:
    parts.store.takes.get(id)
    return Response(
        parts.videos.picture(id, number), media_type="image/jpeg", headers={"Cache-Control": ALWAYS_THE_SAME}
    )


@router.get(
    "/{id}/hand", response_model=HandBeside, summary="A model's hand at each picture",
    responses=problems(409),
)  # fmt: skip
def get_hand(
    id: IdInPath,
    model: Annotated[str, Query(pattern=SHA256_PREFIX, description="A model's id, or its first digits.")],
    parts: PartsNeeded,
) -> HandBeside:
    """What is not calibrated follows its rule or rests, as everywhere."""
    take, facts = parts.store.takes.get(id), parts.videos.facts(id)
    found, _ = parts.predictors.get(parts.store.models.get(model).id)
    skeleton = parts.store.subjects.get(take.subject).skeleton(take.known_hand)
    motion = motion_of(parts.store.takes.load_recorded(id), found, skeleton, "hand")
    at, time_s = np.array(facts.times_s), motion.time_s
    inside = (at >= time_s[0]) & (at <= time_s[-1])
    shown = at_times(motion, np.clip(at, time_s[0], time_s[-1]))
    hands = completed(shown.rotations, shown.degrees, skeleton.rotations)
    known = inside & np.isfinite(shown.degrees).any(axis=1)
    rows = plain(np.round(hands, 3))
    return HandBeside(
        rotations=list(skeleton.rotations),
        degrees=[row if is_known else None for row, is_known in zip(rows, known.tolist(), strict=True)],
    )
