"""Job kind ``ceiling``: a model and takes in; out whether anything is left to gain from what was recorded."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from glovecal_models.ceiling.ceiling import RECIPE
from glovecal_models.progress import Report
from glovecal_service.jobs.job_kind import JobPlan, Step, Task, TaskResult
from glovecal_service.jobs.model_work import ModelWork, takes_of, text_in
from glovecal_service.jobs.task_key import task_key
from glovecal_service.store import Store
from glovecal_service.store.records import JobRecord, ModelRecord
from glovecal_service.views.ceiling import CeilingResult, CeilingView


@dataclass(frozen=True)
class CeilingWork:
    on: ModelWork
    seed: int


class CeilingJob:
    """Payload: ``model``, ``takes`` (ids, or None for those it was trained on), ``seed``.

    Result: ``CeilingResult``.
    """

    def plan(self, store: Store, job: JobRecord) -> JobPlan:
        """Raises NotFound (model, takes), NotTrainable (no reference), BadInput, DamagedArtifact."""
        payload = job.payload
        record = store.models.get(text_in(payload, "model"))
        on = ModelWork.of(store, record, takes_of(store, record, payload.get("takes")))
        work = CeilingWork(on, int(payload.get("seed", 0)))
        facts = {"model": on.id, "takes": list(on.take_hashes), "seed": work.seed, "recipe": RECIPE}

        def finish(results: Sequence[TaskResult]) -> dict[str, Any]:
            return CeilingResult.model_validate({**results[0].facts, "model": record.id}).document()

        return JobPlan(
            tasks=[Task(task_key("ceiling", facts), f"ceiling of model {record.id[:12]}", run, work)],
            step=lambda number, results: Step("the ceiling is known"),
            finish=finish,
        )


def run(work: CeilingWork, cancelled: Callable[[], bool], report: Report) -> TaskResult:
    """In a worker. Raises BadInput, NotTrainable, Cancelled."""
    from glovecal_models.ceiling.black_box_ceiling import black_box_ceiling  # heavy

    model = work.on.model
    found = black_box_ceiling(
        model, work.on.takes, work.on.settings, seed=work.seed, cancelled=cancelled, report=report
    )
    view = CeilingView.of(found)
    assert view is not None
    return TaskResult({}, view.document())


def known_ceiling(store: Store, record: ModelRecord) -> Mapping[str, Any] | None:
    """What was last found for this model, by ``improve`` or by a job; None when nobody asked."""
    for job in store.jobs.list(subject=record.subject):
        if job.kind == "ceiling" and job.payload.get("model") == record.id and job.result:
            return job.result
    return record.facts.get("ceiling")
