"""Job kind ``remove_effect``: a model and one of its effects in, a stored child without it out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from glovecal_models.improvement.remove_effect import remove_effect
from glovecal_models.progress import Report
from glovecal_service.jobs.child_record import artifact_array, keep_child
from glovecal_service.jobs.job_kind import JobPlan, Step, Task, TaskResult
from glovecal_service.jobs.model_work import ModelWork, takes_of, text_in
from glovecal_service.jobs.task_key import task_key
from glovecal_service.plain import plain
from glovecal_service.store import Store
from glovecal_service.store.records import JobRecord


@dataclass(frozen=True)
class RemovalWork:
    on: ModelWork
    effect: str


class RemoveEffectJob:
    """Payload: ``model``, ``effect``, ``activate``.

    Result: ``effect``, ``model`` (the child), ``parent``, ``before`` and ``after`` (held-out degrees over all
    rotations), ``sentence``, ``active``.
    """

    def plan(self, store: Store, job: JobRecord) -> JobPlan:
        """Raises NotFound (model, takes), BadInput, DamagedArtifact."""
        payload = job.payload
        record = store.models.get(text_in(payload, "model"))
        takes = takes_of(store, record, None)
        work = RemovalWork(ModelWork.of(store, record, takes), text_in(payload, "effect"))
        facts = {"model": record.id, "takes": list(work.on.take_hashes), "effect": work.effect}

        def finish(results: Sequence[TaskResult]) -> dict[str, Any]:
            (result,) = results
            before, after = record.facts.get("held_out_rmse_deg"), result.facts["after"]
            goes = f" from {before:.2f}" if before is not None else ""
            sentence = f"without {work.effect} the error on takes left out goes{goes} to {after:.2f} degrees."
            active = bool(payload.get("activate", False))
            document = {"effect": work.effect, "before": before, "after": after, "sentence": sentence}
            child = keep_child(
                store,
                result.arrays["artifact"],
                record.layout,
                takes,
                work.on.settings,
                {"removal": document, "sentences": [sentence]},
                activate=active,
            )
            return {**document, "parent": record.id, "model": child.id, "active": active}

        return JobPlan(
            tasks=[Task(task_key("remove_effect", facts), f"without {work.effect}", run, work)],
            step=lambda number, results: Step(f"learned without {work.effect}"),
            finish=finish,
            in_this_process=work.on.is_short,
        )


def run(work: RemovalWork, cancelled: Callable[[], bool], report: Report) -> TaskResult:
    """In a worker. Raises BadInput, NotTrainable, Cancelled."""
    on, model = work.on, work.on.model
    report(f"learning again without {work.effect}", 0.1)
    child = remove_effect(
        model,
        on.takes,
        work.effect,
        settings=on.settings,
        parent_id=on.id,
        take_hashes=on.take_hashes,
        cancelled=cancelled,
    )
    facts = {"after": plain(child.error_estimate.get("rmse_deg"))}
    return TaskResult({"artifact": artifact_array(child)}, facts)
