"""``films``: a video beside recordings, by a camera of the service's computer."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter
from pydantic import Field

from glovecal_models.errors import BadInput
from glovecal_service.filming import FilmState
from glovecal_service.request_types import Id, StrictBody
from glovecal_service.rest.glove.answer import Film
from glovecal_service.rest.http.dependencies import PartsNeeded
from glovecal_service.rest.http.problem import change_problems, problems
from glovecal_service.rest.take.videos import attach_preview
from glovecal_service.store.errors import Conflict

router = APIRouter(prefix="/films", tags=["recordings"])

MOST_TAKES = 16
Source = Annotated[str, Field(pattern=r"^(camera:[0-9]{1,2}|rendered)$")]


class NewFilm(StrictBody):
    source: Source = Field(description="camera:0 is the first; rendered draws pictures, to try.")


class FilmedTakes(StrictBody):
    takes: Annotated[list[Id], Field(max_length=MOST_TAKES)] = Field(
        default_factory=list, description="Those beside which it is shown from now on."
    )


@router.post(
    "", status_code=201, response_model=Film, summary="Start a video", responses=change_problems(409)
)
def start_film(body: NewFilm, parts: PartsNeeded) -> Film:
    """Answers once the first picture is there; 422 with what the camera says, 409 while another is filmed."""
    return _film(parts.filming.start(body.source))


@router.get("", response_model=Film | None, summary="The last video", responses=problems())
def get_film(parts: PartsNeeded) -> Film | None:
    """Null before the first."""
    state = parts.filming.state()
    return None if state is None else _film(state)


@router.post("/stop", response_model=Film, summary="End the video", responses=change_problems(409))
def stop_film(body: FilmedTakes, parts: PartsNeeded) -> Film:
    """The video stays in the data folder; each take gets a small copy, or a sentence says why not."""
    state, preview = parts.filming.stop()
    sentences = []
    try:
        for id in body.takes:
            take = parts.store.takes.get(id)
            try:
                video = attach_preview(parts, take, preview)
                sentences.append(f"{take.name}: {video.sentence}")
            except (BadInput, Conflict) as error:
                sentences.append(f"{take.name}: {error}")
    finally:
        preview.unlink()
    return _film(state, sentences)


def _film(state: FilmState, sentences: list[str] | None = None) -> Film:
    return Film(
        source=state.source, file=state.file.name, is_on=state.is_on, pictures=state.pictures,
        problem=state.problem, sentences=sentences or [],
    )  # fmt: skip
