"""Which physical effect does a model lack?"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
from pydantic import ValidationError

from glovecal_models.calibration.artifact import load
from glovecal_models.comparison.residuals import residuals
from glovecal_models.diagnosis.answer import DECIDED, MissingEffects, TakeSetAside
from glovecal_models.errors import BadInput, DamagedArtifact
from glovecal_models.parts import Part, Undivided
from glovecal_models.progress import Cancel, Report
from glovecal_models.takes.take import Take
from glovecal_service.questions.ceiling import known_ceiling
from glovecal_service.questions.question import Asked, Detail, Question, WorkOnTakes
from glovecal_service.request_types import Seed, StrictBody
from glovecal_service.store import Store
from glovecal_service.store.records import ModelRecord

FITS_DEG, FITS, OF_ITS_ERROR = 3.0, 3.0, 0.5
"""Another subject's model fits an odd take with an error of at most so many degrees, or so many times that of
the other takes, and so much of its own."""
MOST_ASKED = 20
"""Subjects whose models are tried: each is loaded and predicts the take."""


class DiagnosisRequest(StrictBody):
    seed: Seed = 0
    """Of the controls."""


def _work(on: WorkOnTakes, request: DiagnosisRequest) -> Undivided[MissingEffects]:
    def worked(cancelled: Cancel | None, report: Report | None) -> MissingEffects:
        """Raises BadInput, Cancelled."""
        from glovecal_models.diagnosis.model_on_takes import diagnose_model  # heavy, and few verbs need it
        from glovecal_models.diagnosis.text import missing_in_model

        model, own = on.loaded, on.own
        found = diagnose_model(
            model, on.takes, own=own, seed=request.seed, cancelled=cancelled, report=report
        )
        return missing_in_model(found.diagnosis, found.odd, model, on.takes, own)

    return Undivided(Part("the diagnosis", MissingEffects, {"seed": request.seed}), worked)


def _finish(store: Store, asked: Asked[DiagnosisRequest], found: MissingEffects) -> MissingEffects:
    """Whose model fits a take that was set aside, and what was found before."""
    record = asked.model
    assert record is not None
    odd = [_named(store, record, asked, item) for item in found.odd_takes]
    return replace(found, odd_takes=odd, ceiling=known_ceiling(store, record), hand=record.hand)


def _named(store: Store, record: ModelRecord, asked: Asked, odd: TakeSetAside) -> TakeSetAside:
    """With its id, and whose model fits it, where that is another subject's."""
    id = asked.takes[odd.place].id
    most_deg = min(OF_ITS_ERROR * odd.error_deg, max(FITS_DEG, FITS * odd.usual_deg))
    whose = _model_that_fits(store, record, store.takes.load(id), most_deg)
    if whose is None:
        return replace(odd, id=id)
    return replace(odd, id=id, how="another subject", sentence=f"{odd.sentence} {whose}")


def _model_that_fits(store: Store, own: ModelRecord, take: Take, most_deg: float) -> str | None:
    """A sentence on the active model of another subject whose error on the take is smallest, and at most
    ``most_deg``; None where there is none. Of many subjects those are asked whose models are newest."""
    best: tuple[float, str] | None = None
    newest = dict.fromkeys(item.subject for item in reversed(store.models.list(layout=own.layout)))
    asked = itertools.islice((one for one in newest if one != own.subject), MOST_ASKED)
    for active in (each for one in asked for each in store.models.active_of_each_hand(one, own.layout)):
        try:
            found = residuals(load(store.models.load_bytes(active.id)), [take])
        except (BadInput, DamagedArtifact):  # it measures nothing of the take, or is told of elsewhere
            continue
        error = float(np.sqrt(np.nanmean(found.stacked("error") ** 2)))
        if error <= most_deg and (best is None or error < best[0]):
            best = error, f"{active.subject}'s model {active.id[:12]} fits it: {error:.1f} degrees."
    return None if best is None else best[1]


def newest_diagnosis(store: Store, record: ModelRecord) -> MissingEffects | None:
    """The last that was finished of a model; None where there is none, or none of this version."""
    done = [
        job
        for job in store.jobs.list(subject=record.subject)
        if job.kind == DIAGNOSE.kind and job.state == "done" and (job.result or {}).get("model") == record.id
    ]
    newest = max(done, key=lambda job: job.updated_at, default=None)
    try:
        return None if newest is None else DIAGNOSE.read(newest.result)
    except ValidationError:
        return None


DIAGNOSE = Question(
    kind="diagnose",
    verb="diagnose",
    of=("model",),
    summary="Find which physical effect the model lacks",
    help="Find which physical effect a model is missing, or why these takes cannot tell.",
    request=DiagnosisRequest,
    answer=MissingEffects,
    work=_work,
    finish=_finish,
    own_effects="effects",
    detail=Detail("explain", "Say which rules decided, in their order (docs/ablation.md).", DECIDED),
    shows_ceiling=True,
    is_short=True,
)
