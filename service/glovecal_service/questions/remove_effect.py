"""A model and one of its effects in, a stored child without it out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from pydantic import BaseModel, ConfigDict, Field

from glovecal_models.calibration.artifact import load
from glovecal_models.improvement.answer import EffectRemoved
from glovecal_models.improvement.remove_effect import remove_effect
from glovecal_models.names import did_you_mean
from glovecal_models.progress import Report
from glovecal_service.jobs.job_kind import JobPlan, Step, TaskResult
from glovecal_service.questions.chosen_takes import model_takes
from glovecal_service.questions.making import Begun, Making, keep, made, models_of, one_task
from glovecal_service.questions.model_work import ModelWork, model_title, takes_of, text_in
from glovecal_service.store import Store
from glovecal_service.store.errors import NotFound
from glovecal_service.store.records import JobRecord


class RemovalRequest(BaseModel):
    model_config = ConfigDict(extra="forbid")

    activate: bool = Field(False, description="Predict live with the child.")


def begin(store: Store, query: RemovalRequest, id: str, name: str) -> Begun:
    record = store.models.get(id)
    has = list(dict.fromkeys(item.name for item in load(store.models.load_bytes(record.id)).effects))
    if name not in has:
        meant = did_you_mean(name, has, there="it has")
        raise NotFound(f"model {record.id[:12]} has no effect {name!r}; {meant}")
    model_takes(store, record, None)
    return Begun(record.subject, {"model": record.id, "effect": name, "activate": query.activate})


@dataclass(frozen=True)
class RemovalWork:
    on: ModelWork
    effect: str
    before: float | None
    """Held-out error with it, degrees."""


def plan(store: Store, job: JobRecord) -> JobPlan:
    """Raises NotFound (model, takes), BadInput, DamagedArtifact."""
    record = store.models.get(text_in(job.payload, "model"))
    takes = takes_of(store, record, None)
    on, effect = ModelWork.of(store, record, takes), text_in(job.payload, "effect")
    work = RemovalWork(on, effect, record.facts.get("held_out_rmse_deg"))

    def finish(result: TaskResult) -> EffectRemoved:
        found, [model] = REMOVE_EFFECT.read(result.facts), models_of(result)
        active = bool(job.payload.get("activate", False))
        removal = {name: result.facts[name] for name in ("effect", "before", "after", "sentence")}
        facts = {"removal": removal, "sentences": [found.sentence]}
        child = keep(store, model, record.layout, takes, on.settings, facts, activate=active)
        title = model_title(store, record.id)
        return replace(found, parent=record.id, model=child.id, active=active, title=title)

    return one_task(
        "remove_effect",
        {**on.identity, "effect": effect},
        f"without {effect}",
        run,
        work,
        lambda facts: Step(f"learned without {effect}"),
        finish,
        is_short=on.is_short,
    )


def run(work: RemovalWork, cancelled: Callable[[], bool], report: Report) -> TaskResult:
    """In a worker. Raises BadInput, NotTrainable, Cancelled."""
    on = work.on
    report(f"learning again without {work.effect}", 0.1)
    child = remove_effect(
        on.model,
        on.takes,
        work.effect,
        settings=on.settings,
        parent_id=on.id,
        take_hashes=on.take_hashes,
        cancelled=cancelled,
    )
    return made(EffectRemoved(work.effect, work.before, child.error_estimate.get("rmse_deg")), [child])


REMOVE_EFFECT = Making(
    kind="remove_effect",
    address="/models/{id}/effects/{name}",
    method="DELETE",
    summary="Take an effect out",
    help="A child model without it is stored; this one stays as it is.",
    request=RemovalRequest,
    answer=EffectRemoved,
    begin=begin,
    planned=plan,
)
