"""Job kind ``add_effect``: a model and one effect in; out a stored child, or why the effect was undone."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from glovecal_models.effects.catalogue import effect_of_declaration
from glovecal_models.improvement.add_effect import add_effect
from glovecal_models.progress import Report
from glovecal_service.jobs.child_record import artifact_array, keep_child
from glovecal_service.jobs.job_kind import JobPlan, Step, Task, TaskResult
from glovecal_service.jobs.model_work import ModelWork, takes_of, text_in
from glovecal_service.jobs.task_key import task_key
from glovecal_service.store import Store
from glovecal_service.store.records import JobRecord
from glovecal_service.views.addition import AdditionResult, AdditionView


@dataclass(frozen=True)
class AdditionWork:
    on: ModelWork
    effect: str
    declaration: dict[str, Any] | None
    """Of a user's own effect."""
    rotations: tuple[str, ...] | None


class AddEffectJob:
    """Payload: ``model``, ``effect`` (name), ``declaration`` (document or None), ``rotations`` (or None for
    all), ``takes`` (ids, or None for those the model was trained on), ``activate``.

    Result: ``AdditionResult``.
    """

    def plan(self, store: Store, job: JobRecord) -> JobPlan:
        """Raises NotFound (model, takes), NotTrainable (no reference), BadInput, DamagedArtifact."""
        payload = job.payload
        record = store.models.get(text_in(payload, "model"))
        takes = takes_of(store, record, payload.get("takes"))
        on = ModelWork.of(store, record, takes)
        rotations = payload.get("rotations")
        work = AdditionWork(
            on,
            text_in(payload, "effect"),
            payload.get("declaration"),
            None if rotations is None else tuple(rotations),
        )
        facts = {"effect": work.effect, "declaration": work.declaration, "rotations": rotations}
        key = task_key("add_effect", {"model": on.id, "takes": list(on.take_hashes), **facts})

        def finish(results: Sequence[TaskResult]) -> dict[str, Any]:
            (result,) = results
            document = {**result.facts, "parent": record.id, "model": None, "active": False}
            if not result.facts["added"]:
                return AdditionResult.model_validate(document).document()
            active = bool(payload.get("activate", False))
            child = keep_child(
                store,
                result.arrays["artifact"],
                record.layout,
                takes,
                on.settings,
                {"addition": result.facts, "sentences": [result.facts["sentence"]]},
                activate=active,
            )
            return AdditionResult.model_validate({**document, "model": child.id, "active": active}).document()

        return JobPlan(
            tasks=[Task(key, f"{work.effect} on model {record.id[:12]}", run, work)],
            step=_step,
            finish=finish,
            in_this_process=on.is_short,
        )


def run(work: AdditionWork, cancelled: Callable[[], bool], report: Report) -> TaskResult:
    """In a worker. Raises BadInput, NotTrainable, Cancelled."""
    on, model = work.on, work.on.model
    known = model.error_estimate.get("rmse_deg")
    error = "" if known is None else f", held-out error {known:.2f} degrees so far"
    report(f"looking at the takes for {work.effect}{error}", 0.0)
    found = add_effect(
        model,
        on.takes,
        work.effect if work.declaration is None else effect_of_declaration(work.declaration),
        rotations=work.rotations,
        settings=on.settings,
        parent_id=on.id,
        take_hashes=on.take_hashes,
        cancelled=cancelled,
        report=report,
    )
    return TaskResult(
        {"artifact": artifact_array(found.model)} if found.added else {}, AdditionView.of(found).document()
    )


def _step(number: int, results: Mapping[int, TaskResult]) -> Step:
    """The last word before the model is stored: the held-out errors before and after."""
    facts = results[number].facts
    return Step(facts["sentence"], {name: facts[name] for name in ("effect", "added", "before", "after")})
