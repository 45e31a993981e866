"""``hidden-effects``: simulated gloves that hide one effect each, to be found by somebody who learns how."""

from __future__ import annotations

import hashlib
import secrets

from fastapi import APIRouter, Response
from pydantic import Field

from glovecal_service.first_run.hidden_effect import SEEDS, TRAINING, HiddenEffects, subject_of
from glovecal_service.questions.train import TRAIN, TrainingRequest
from glovecal_service.request_types import StrictBody
from glovecal_service.rest.first_run.answer import HiddenEffectView
from glovecal_service.rest.first_run.simulated_glove import training_of
from glovecal_service.rest.http.dependencies import Parts, PartsNeeded
from glovecal_service.rest.http.list_part import InParts
from glovecal_service.rest.http.problem import change_problems, problems
from glovecal_service.rest.http.request_types import SubjectInPath
from glovecal_service.rest.job.jobs import new_job
from glovecal_service.rest.take.import_takes import import_takes
from glovecal_service.store.errors import Conflict, NotFound

router = APIRouter(prefix="/hidden-effects", tags=["first run"])


class NewHiddenEffect(StrictBody):
    seed: int | None = Field(None, ge=0, lt=SEEDS, description="Null: drawn.")


@router.post(
    "",
    status_code=201,
    response_model=HiddenEffectView,
    summary="Hide an effect in a simulated glove",
    responses=change_problems(409),
)
def hide_effect(body: NewHiddenEffect, parts: PartsNeeded, response: Response) -> HiddenEffectView:
    """Twelve takes of 20 s in three wearings are made, and the training of a model without the effect begins;
    the last take of each wearing is held out. 409 for a seed that was used already."""
    from glovecal_service.first_run.hidden_session import hidden_session  # loads long: few ask for it

    store = parts.store
    seed = secrets.randbelow(SEEDS) if body.seed is None else body.seed
    subject = subject_of(seed)
    if subject in store.subjects.names():
        raise Conflict(f"subject {subject} is here already; give another seed")
    session = hidden_session("random", seed)
    session.write_truth(HiddenEffects(parts.settings.data).folder(subject))
    learned, layout = [], None
    for name, takes in (("training", session.training), ("test", session.test)):
        made = import_takes(
            store, lambda takes=takes: takes,
            original_sha256=hashlib.sha256(f"{subject} {name}".encode()).hexdigest(),
            subject=subject, layout=layout, create_subject=True,
        )  # fmt: skip
        layout = made.layout
        learned += made.imported if name == "training" else []
    asked = {"subject": subject, "layout": layout, "takes": learned} | TRAINING
    begun = TRAIN.begin(store, TrainingRequest.model_validate(asked))
    new_job(store, response, TRAIN.kind, begun.payload, begun.subject)
    return _view(parts, subject)


@router.get(
    "", response_model=list[HiddenEffectView], summary="Hidden effects, newest first", responses=problems()
)
def list_hidden_effects(parts: PartsNeeded, paging: InParts) -> list[HiddenEffectView]:
    """Of subjects that are still there."""
    here = parts.store.subjects.names()
    known = [name for name in HiddenEffects(parts.settings.data).subjects() if name in here]
    return [_view(parts, name) for name in paging.part_of(known, str)]


@router.get("/{subject}", response_model=HiddenEffectView, summary="One hidden effect", responses=problems())
def get_hidden_effect(subject: SubjectInPath, parts: PartsNeeded, reveal: bool = False) -> HiddenEffectView:
    """`reveal` tells what was hidden to somebody who gives up. 404 for a subject that hides none."""
    return _view(parts, subject, reveal=reveal)


def _view(parts: Parts, subject: str, *, reveal: bool = False) -> HiddenEffectView:
    kept = HiddenEffects(parts.settings.data).of(subject)
    if kept is None:
        raise NotFound(f"no effect was hidden for subject {subject!r}; POST /v1/hidden-effects makes one")
    models = parts.store.models.list(subject=subject)
    added = next((list(each.facts["effects"]) for each in reversed(models) if each.facts.get("effects")), [])
    verdict, sentences = None, [kept.sentence] if added or reveal else []
    if added:
        verdict, sentence = kept.verdict(added)
        sentences.insert(0, sentence)
    return HiddenEffectView(
        subject=subject, seed=kept.seed, job=training_of(parts.store, subject),
        models=[each.id for each in models], added=added, verdict=verdict, sentences=sentences,
    )  # fmt: skip
