"""Job kind ``diagnose``: a model and takes in, the evidence for missing effects out."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from glovecal_models.calibration.artifact import load
from glovecal_models.comparison.residuals import residuals
from glovecal_models.effects.catalogue import effect_of_declaration
from glovecal_models.errors import BadInput, DamagedArtifact
from glovecal_models.progress import Report
from glovecal_models.takes.take import Take
from glovecal_models.takes.take_warnings import excluded_sentences
from glovecal_service.jobs.ceiling import known_ceiling
from glovecal_service.jobs.job_kind import JobPlan, Step, Task, TaskResult
from glovecal_service.jobs.model_work import ModelWork, takes_of, text_in
from glovecal_service.jobs.task_key import task_key
from glovecal_service.store import Store
from glovecal_service.store.records import JobRecord, ModelRecord, TakeRecord
from glovecal_service.views.diagnosis import DiagnosisResult, DiagnosisView
from glovecal_service.views.training import effect_view

FITS_DEG, FITS, OF_ITS_ERROR = 3.0, 3.0, 0.5
"""Another subject's model fits an odd take with an error of at most so many degrees, or so many times that of
the other takes, and so much of its own."""
MOST_ASKED = 20
"""Subjects whose models are tried: each is loaded and predicts the take."""


@dataclass(frozen=True)
class DiagnosisWork:
    on: ModelWork
    seed: int
    declarations: tuple[dict[str, Any], ...]
    """Effects of the user's own that are tried beside the catalogue's."""


class DiagnoseJob:
    """Payload: ``model``, ``takes`` (ids, or None for those it was trained on), ``seed``, ``declarations``.

    Result: ``DiagnosisResult``.
    """

    def plan(self, store: Store, job: JobRecord) -> JobPlan:
        """Raises NotFound (model, takes), NotTrainable (no reference), BadInput, DamagedArtifact."""
        payload = job.payload
        record = store.models.get(text_in(payload, "model"))
        takes = takes_of(store, record, payload.get("takes"))
        on = ModelWork.of(store, record, takes)
        work = DiagnosisWork(on, int(payload.get("seed", 0)), tuple(payload.get("declarations") or ()))
        facts = {"seed": work.seed, "declarations": list(work.declarations)}
        key = task_key("diagnose", {"model": on.id, "takes": list(on.take_hashes), **facts})

        def finish(results: Sequence[TaskResult]) -> dict[str, Any]:
            named = [{"id": take.id, "name": take.name} for take in takes]
            odd = [
                _odd_take(store, record, on, takes, item) for item in results[0].facts.get("odd_takes", ())
            ]
            facts = {**results[0].facts, "model": record.id, "method": record.method, "takes": named}
            facts["odd_takes"] = odd
            facts["excluded"] = excluded_sentences(on.takes)
            facts["model_effects"] = [effect_view(item) for item in on.model.effects]
            facts["ceiling"] = known_ceiling(store, record)
            return DiagnosisResult.model_validate(facts).document()

        return JobPlan(
            tasks=[Task(key, f"diagnosis of model {record.id[:12]}", run, work)],
            step=lambda number, results: Step("the diagnosis is made"),
            finish=finish,
            in_this_process=on.is_short,
        )


def run(work: DiagnosisWork, cancelled: Callable[[], bool], report: Report) -> TaskResult:
    """In a worker. Raises BadInput, Cancelled."""
    from glovecal_models.diagnosis.model_on_takes import diagnose_model  # heavy, and many commands run no job

    own = [effect_of_declaration(item) for item in work.declarations]
    found = diagnose_model(
        work.on.model, work.on.takes, own=own, seed=work.seed, cancelled=cancelled, report=report
    )
    facts = [{**asdict(item), "sentence": item.sentence} for item in found.odd if item.is_set_aside]
    return TaskResult({}, {**DiagnosisView.of(found.diagnosis).document(), "odd_takes": facts})


def _odd_take(
    store: Store, record: ModelRecord, on: ModelWork, takes: Sequence[TakeRecord], facts: dict[str, Any]
) -> dict[str, Any]:
    """With its id, and whose model fits it, where that is another subject's."""
    place = facts.pop("place")
    most_deg = min(OF_ITS_ERROR * facts["error_deg"], max(FITS_DEG, FITS * facts["usual_deg"]))
    whose = _model_that_fits(store, record, on.takes[place], most_deg)
    if whose is not None:
        facts |= {"how": "another subject", "sentence": f"{facts['sentence']} {whose}"}
    return {**facts, "id": takes[place].id}


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
