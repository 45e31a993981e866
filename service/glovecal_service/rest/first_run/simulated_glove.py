"""``simulated-glove``: one that streams into this service, with a model, for somebody without a glove."""

from __future__ import annotations

import hashlib

from fastapi import APIRouter, Response

from glovecal_service.first_run.simulated_glove import GLOVE, LAYOUT, SUBJECT, TRAINED_SOON, taught_takes
from glovecal_service.questions.train import TRAIN, TrainingRequest
from glovecal_service.request_types import StrictBody
from glovecal_service.rest.first_run.answer import SimulatedGloveView
from glovecal_service.rest.http.dependencies import Parts, PartsNeeded
from glovecal_service.rest.http.problem import change_problems, problems
from glovecal_service.rest.job.jobs import new_job
from glovecal_service.rest.take.import_takes import import_takes
from glovecal_service.store.store import Store

router = APIRouter(prefix="/simulated-glove", tags=["first run"])


@router.get("", response_model=SimulatedGloveView, summary="The simulated glove", responses=problems())
def get_simulated_glove(parts: PartsNeeded) -> SimulatedGloveView:
    return _view(parts)


class Streams(StrictBody):
    is_on: bool


@router.put(
    "",
    response_model=SimulatedGloveView,
    summary="Stream the simulated glove, or stop it",
    responses=change_problems(409),
)
def stream_simulated_glove(body: Streams, parts: PartsNeeded, response: Response) -> SimulatedGloveView:
    """For half an hour at most, and never longer than the service. Where its hand has no model, takes are
    made and one is trained; until then its poses are uncalibrated. Takes and model stay: the next time its
    hand moves at once. 409 where too many jobs are waiting."""
    if body.is_on:
        parts.streamed_glove.start()
        if _active(parts.store) is None and training_of(parts.store, SUBJECT) is None:
            _train(parts.store, response)
    else:
        parts.streamed_glove.stop()
    return _view(parts)


def training_of(store: Store, subject: str) -> str | None:
    """The id of the training of that subject that has not finished."""
    jobs = store.jobs.list(subject=subject, only_unfinished=True)
    return next((job.id for job in jobs if job.kind == TRAIN.kind), None)


def _train(store: Store, response: Response) -> None:
    made = import_takes(
        store, taught_takes, original_sha256=hashlib.sha256(SUBJECT.encode()).hexdigest(),
        subject=SUBJECT, layout=LAYOUT, create_subject=True,
    )  # fmt: skip
    takes = [take.id for take in made.takes]
    asked = {"subject": SUBJECT, "layout": LAYOUT, "takes": takes} | TRAINED_SOON
    begun = TRAIN.begin(store, TrainingRequest.model_validate(asked))
    new_job(store, response, TRAIN.kind, begun.payload, begun.subject)


def _active(store: Store) -> str | None:
    active = store.models.active(SUBJECT, LAYOUT)
    return None if active is None else active.id


def _view(parts: Parts) -> SimulatedGloveView:
    state, store = parts.streamed_glove.state(), parts.store
    return SimulatedGloveView(
        glove=GLOVE, subject=SUBJECT, is_on=state.is_on, sentence=state.sentence, left_s=state.left_s,
        job=training_of(store, SUBJECT), model=_active(store),
    )  # fmt: skip
