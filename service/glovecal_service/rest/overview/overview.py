"""``overview``: what there is, and what to do next; for ``glovecal`` alone and every page of the studio."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from fastapi import APIRouter, Query, Response

from glovecal_models.presentation.document import counted
from glovecal_service.request_types import SubjectName
from glovecal_service.rest.http.dependencies import StoreNeeded
from glovecal_service.rest.http.problem import problems, warn_of_damaged, without_damaged
from glovecal_service.rest.overview.answer import DEMO, FIRST_STEPS, IMPORT, NextStep, Overview
from glovecal_service.store.list_part import ListPart
from glovecal_service.store.records import GloveRecord, ModelRecord, TakeRecord
from glovecal_service.store.store import Store

router = APIRouter(prefix="/overview", tags=["health"])

SHORT = 12
MOST_GLOVES = 3
"""Without a calibration that are told of."""
LOOKED_AT = 200
"""Of takes and of models, the newest ones: they say what is next."""


@router.get("", response_model=Overview, summary="What there is, and what to do next", responses=problems())
def get_overview(
    store: StoreNeeded,
    response: Response,
    subject: SubjectName | None = None,
    model: Annotated[str | None, Query(max_length=64, description="None: the newest.")] = None,
) -> Overview:
    """Of everybody: the steps are those of whose take or model is the newest. Of one subject: its own."""
    newest = ListPart(LOOKED_AT, reverse=True)
    of_takes = store.takes.page(newest, subject=subject)
    of_models = store.models.page(newest, subject=subject)
    warn_of_damaged(response, [*of_takes.damaged, *of_models.damaged])
    takes, models = of_takes.records[::-1], of_models.records[::-1]
    every_take, every_model = of_takes.total or 0, of_models.total or 0
    every_active = store.models.count_active(subject)
    subjects = store.subjects.count() if subject is None else len({subject} & store.subjects.names())
    looked_at = [*models, *([store.models.get(model)] if model else [])]
    active, _ = store.models.active_among(looked_at[-1:])
    teaching = [take for take in takes if take.teaches]
    seen = without_damaged(response, store.gloves.list)
    gloves = [glove for glove in seen if subject is None or glove.subject in (None, subject)]
    facts = [
        counted(subjects, "subject"), counted(every_take, "take"),
        f"{counted(every_model, 'model')}, {every_active} active",
    ]  # fmt: skip
    return Overview(
        subjects=subjects,
        takes=every_take,
        teaching_takes=len(teaching),
        models=every_model,
        active_models=every_active,
        unfinished_jobs=sum(store.jobs.unfinished().values()),
        sentence=", ".join(facts) + "." if takes or models else "Nothing is here yet.",
        steps=_steps(store, takes, looked_at, active, gloves),
    )


def _steps(
    store: Store,
    takes: Sequence[TakeRecord],
    models: Sequence[ModelRecord],
    active: set[str],
    gloves: Sequence[GloveRecord],
) -> list[NextStep]:
    """Takes: the newest last. Models: the one that is looked at last."""
    teaching = [take for take in takes if take.teaches]
    newest = teaching[-1].created_at if teaching else None
    if models and (newest is None or any((model.created_at or newest) >= newest for model in models)):
        return [*_of_model(store, models, active), IMPORT]
    if teaching:
        subject = teaching[-1].subject
        own = [take for take in teaching if take.subject == subject]
        train = NextStep(
            sentence=f"{counted(len(own), 'take')} of {subject} can teach a model.",
            command=f"glovecal train --subject {subject}", page="takes", label="Train a model",
        )  # fmt: skip
        return [train, IMPORT]
    calibrate = [_calibrate(glove) for glove in gloves[:MOST_GLOVES]]
    if takes:
        reference = NextStep(
            sentence="No angles were measured yet: attach them to a take, or record poses with known angles.",
            command=f"glovecal take reference {takes[-1].id[:SHORT]} FILE",
            page=f"take?id={takes[-1].id}", label="Attach a reference",
        )  # fmt: skip
        return [*calibrate, reference, IMPORT]
    return [*calibrate, IMPORT, DEMO] if calibrate else list(FIRST_STEPS)


def _calibrate(glove: GloveRecord) -> NextStep:
    whose = f" of {glove.subject}" if glove.subject else ""
    return NextStep(
        sentence=f"Glove {glove.name}{whose} has no calibration yet: hold poses with known angles.",
        command=f"glovecal sample --glove {glove.name}",
        page=f"capture?who={glove.subject}" if glove.subject else "capture",
        label="Calibrate this hand",
    )


def _of_model(store: Store, models: Sequence[ModelRecord], active: set[str]) -> list[NextStep]:
    """Of the last one."""
    model = models[-1]
    short = model.id[:SHORT]
    if better := _better_versions(model, models):
        version = better[-1]
        fall = NextStep(
            sentence=f"Model {short} of {model.subject} errs by {_error(model):.2f} degrees, its version "
            f"{version.id[:SHORT]} by {_error(version):.2f}.",
            command=f"glovecal model activate {version.id[:SHORT]}", page=f"fall?model={version.id}",
            label="See the error fall",
        )  # fmt: skip
        return [fall]
    jobs = store.jobs.list(subject=model.subject, part=ListPart(text=model.id))
    diagnosed = any(
        job.kind == "diagnose" and job.state == "done" and job.payload.get("model") == model.id
        for job in jobs
    )
    diagnose = NextStep(
        sentence=f"What model {short} of {model.subject} lacks "
        + ("was found: add it, or record what decides." if diagnosed else "is not known yet."),
        command=f"glovecal diagnose {short}", page=f"diagnose?model={model.id}",
        label="See what is missing" if diagnosed else "Which effect is missing?",
    )  # fmt: skip
    activate = NextStep(
        sentence=f"Model {short} is not active: live poses do not come from it.",
        command=f"glovecal model activate {short}", page="models", label="Choose the live model",
    )  # fmt: skip
    return [diagnose] if model.id in active else [diagnose, activate]


def _better_versions(model: ModelRecord, models: Sequence[ModelRecord]) -> list[ModelRecord]:
    """Made of it, with a smaller held-out error; the best one last."""
    made = [each for each in models if each.parent == model.id and _error(each) < _error(model)]
    return sorted(made, key=_error, reverse=True)


def _error(model: ModelRecord) -> float:
    """Held-out, degrees; not a number where none was measured."""
    error = model.facts.get("held_out_rmse_deg")
    return float("nan") if error is None else float(error)
