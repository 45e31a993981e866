"""Job kind ``improve``: takes in; out every model from the base to the last effect, each step stored."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from glovecal_models.calibration.artifact import dump, load
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.errors import BadInput
from glovecal_models.layout import Layout
from glovecal_models.progress import Report
from glovecal_models.takes.take import Take
from glovecal_service.jobs.child_record import keep_child
from glovecal_service.jobs.job_kind import JobPlan, Task, TaskResult
from glovecal_service.jobs.job_kind import Step as JobStep
from glovecal_service.jobs.model_work import is_short, text_in
from glovecal_service.jobs.task_key import task_key
from glovecal_service.store import Store
from glovecal_service.store.records import JobRecord, TakeRecord, incomplete_sentences
from glovecal_service.views.improvement import ImprovementView

MOST_STEPS = 6


@dataclass(frozen=True)
class ImprovementWork:
    takes: tuple[Take, ...]
    take_hashes: tuple[str, ...]
    holdout: tuple[Take, ...]
    layout: Layout
    subject: str
    settings: TrainingSettings
    most_steps: int
    seed: int
    ceiling: bool


class ImproveJob:
    """Payload: ``subject``, ``layout``, ``takes`` and ``holdout`` (ids), ``method``, ``samples``,
    ``max_steps``, ``seed``, ``ceiling`` (whether to ask for it at the end), ``activate`` (the last model).

    Result: ``ImprovementView``; every step's model is stored, each the next one's parent.
    """

    def plan(self, store: Store, job: JobRecord) -> JobPlan:
        """Raises NotFound (subject, layout, takes), BadInput, DamagedArtifact."""
        payload = job.payload
        layout = text_in(payload, "layout")
        takes = [store.takes.get(id) for id in payload["takes"]]
        holdout = [store.takes.get(id) for id in payload.get("holdout") or ()]
        work = _work(store, payload, takes, holdout)
        facts = {
            "subject": work.subject,
            "layout": work.layout.to_document(),
            "takes": [[take.name, take.artifact] for take in takes],
            "holdout": [take.artifact for take in holdout],
            "settings": asdict(work.settings),
            "most_steps": work.most_steps,
            "seed": work.seed,
            "ceiling": work.ceiling,
        }

        def finish(results: Sequence[TaskResult]) -> dict[str, Any]:
            activate = bool(payload.get("activate"))
            kept = _keep(store, results[0], layout, takes, work.settings, activate)
            sentences = [*incomplete_sentences([*takes, *holdout]), *kept["sentences"]]
            return ImprovementView.model_validate({**kept, "sentences": sentences}).document()

        return JobPlan(
            tasks=[Task(task_key("improve", facts), f"improving {work.subject}", run, work)],
            step=_step,
            finish=finish,
            in_this_process=is_short([*work.takes, *work.holdout]),
        )


def run(work: ImprovementWork, cancelled: Callable[[], bool], report: Report) -> TaskResult:
    """In a worker. Raises BadInput, NotTrainable, Cancelled."""
    from glovecal_models.improvement.improve import improve  # heavy, and many commands run no job

    found = improve(
        work.takes,
        work.layout,
        work.subject,
        work.settings,
        holdout=work.holdout,
        max_steps=work.most_steps,
        seed=work.seed,
        take_hashes=work.take_hashes,
        ceiling=work.ceiling,
        cancelled=cancelled,
        report=report,
    )
    arrays = {
        f"model{number}": np.frombuffer(dump(model), np.uint8) for number, model in enumerate(found.models)
    }
    return TaskResult(arrays, ImprovementView.of(found).document())


def _work(
    store: Store, payload: Mapping[str, Any], takes: Sequence[TakeRecord], holdout: Sequence[TakeRecord]
) -> ImprovementWork:
    chosen = {name: payload[name] for name in ("method", "samples") if payload.get(name) is not None}
    return ImprovementWork(
        tuple(store.takes.load(take.id) for take in takes),
        tuple(take.artifact for take in takes),
        tuple(store.takes.load(take.id) for take in holdout),
        store.layouts.get(text_in(payload, "layout")),
        store.subjects.get(text_in(payload, "subject")).name,
        TrainingSettings(**chosen),
        int(payload.get("max_steps", MOST_STEPS)),
        int(payload.get("seed", 0)),
        bool(payload.get("ceiling", False)),
    )


def _keep(
    store: Store,
    result: TaskResult,
    layout: str,
    takes: Sequence[TakeRecord],
    settings: TrainingSettings,
    activate: bool,
) -> dict[str, Any]:
    """Store each step's model under the one before it; the result with their ids."""
    steps: list[dict[str, Any]] = []
    parent: str | None = None
    learned = set(load(result.arrays["model0"].tobytes()).takes) if result.facts["steps"] else set()
    takes = [take for take in takes if take.artifact in learned]
    for number, step in enumerate(result.facts["steps"]):
        model = load(result.arrays[f"model{number}"].tobytes())
        model = replace(model, parent=parent)
        facts: dict[str, Any] = {"held_out_rmse_deg": step["rmse_deg"], "per_rotation": step["per_rotation"]}
        if step["added"] is not None:
            facts["addition"] = step["added"]
        if number == len(result.facts["steps"]) - 1 and result.facts.get("ceiling"):
            facts["ceiling"] = result.facts["ceiling"]
        content = np.frombuffer(dump(model), np.uint8)
        parent = keep_child(store, content, layout, takes, settings, facts).id
        steps.append({**step, "model": parent})
    if parent is None:
        raise BadInput("nothing was trained")
    if activate:
        store.models.activate(parent)
    return {**result.facts, "steps": steps}


def _step(number: int, results: Mapping[int, TaskResult]) -> JobStep:
    """The last word before the models are stored: the errors of all steps."""
    facts = results[number].facts
    errors = [step["rmse_deg"] for step in facts["steps"]]
    shown = " to ".join(f"{error:.2f}" for error in errors if error is not None)
    return JobStep(f"the error goes from {shown} degrees", {"rmse_deg": errors, "stopped": facts["stopped"]})
