"""Questions that are answered by new calibration models in the store: training, effects, the whole loop.

From one file each follow the job kind, the REST route (``rest/asking.py``) and the page of a finished job.
A worker's models are stored when all is done, so that a cancelled or killed job has stored nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Generic, Literal, TypeVar

import numpy as np
from pydantic import BaseModel, ValidationError

from glovecal_models.calibration.artifact import dump, load
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.errors import BadInput
from glovecal_models.presentation.document import Answer
from glovecal_service.jobs.job_kind import JobPlan, Step, Task, TaskResult
from glovecal_service.jobs.task_key import task_key
from glovecal_service.plain import document_of, plain, read
from glovecal_service.store import Store
from glovecal_service.store.records import (
    LEFT_OUT,
    JobRecord,
    ModelRecord,
    TakeRecord,
    hand_of,
    incomplete_sentences,
)

Request = TypeVar("Request", bound=BaseModel)
Found = TypeVar("Found", bound=Answer)
Work = TypeVar("Work")


@dataclass(frozen=True)
class Begun:
    """A request that was not refused, as the job's row keeps it."""

    subject: str
    payload: Mapping[str, Any]


@dataclass(frozen=True)
class Making(Generic[Request, Found]):
    """One question that is answered by new models."""

    kind: str
    """Of its jobs."""
    address: str
    """Of its route; names in braces are given to ``begin``."""
    summary: str
    help: str
    request: type[Request]
    answer: type[Found]
    begin: Callable[..., Begun]
    """Takes the store, the request, and the names of the address. Refuses what cannot be done, before any
    work: raises NotFound, Conflict, BadInput, NotTrainable."""
    planned: Callable[[Store, JobRecord], JobPlan]
    method: Literal["POST", "DELETE"] = "POST"
    """With DELETE the request stands in the query."""

    def requested(self, payload: Mapping[str, Any]) -> Request:
        """The request that a job's row holds. Raises BadInput."""
        try:
            return self.request.model_validate(payload)
        except ValidationError as error:
            first = error.errors()[0]
            refusal = first.get("ctx", {}).get("error")
            if isinstance(refusal, BadInput):
                raise refusal from error
            where = ".".join(map(str, first["loc"]))
            raise BadInput(
                f"a job of kind {self.kind} cannot have {where} = {first['input']!r}; begin it anew"
            ) from error

    def plan(self, store: Store, job: JobRecord) -> JobPlan:
        return self.planned(store, job)

    def read(self, document: Any) -> Found:
        """The answer from its document. Raises pydantic.ValidationError."""
        return read(self.answer, document)


def made(found: Any, models: Sequence[CalibrationModel] = ()) -> TaskResult:
    """What a worker found, and the models that may be stored."""
    arrays = {f"model{number}": np.frombuffer(dump(model), np.uint8) for number, model in enumerate(models)}
    return TaskResult(arrays, document_of(found))


def models_of(result: TaskResult) -> list[CalibrationModel]:
    """Those that ``made`` was given."""
    return [load(result.arrays[f"model{number}"].tobytes()) for number in range(len(result.arrays))]


def one_task(
    kind: str,
    facts: Mapping[str, Any],
    label: str,
    function: Callable[..., TaskResult],
    work: Any,
    step: Callable[[Mapping[str, Any]], Step],
    finish: Callable[[TaskResult], Answer],
    *,
    is_short: bool,
) -> JobPlan:
    """A job that is done in one piece; ``facts`` and ``kind`` decide its result."""
    return JobPlan(
        tasks=[Task(task_key(f"made by {kind}", facts), label, function, work)],
        step=lambda number, results: step(results[number].facts),
        finish=lambda results: document_of(finish(results[0])),
        in_this_process=is_short,
    )


def keep(
    store: Store,
    model: CalibrationModel,
    layout: str,
    takes: Sequence[TakeRecord],
    settings: TrainingSettings,
    facts: Mapping[str, Any],
    *,
    activate: bool = False,
) -> ModelRecord:
    """Store a model; ``facts`` go beside those that every model has. The very same again changes nothing."""
    error = model.error_estimate
    record = store.models.add(
        dump(model),
        subject=model.subject,
        layout=layout,
        method=model.method,
        parent=model.parent,
        hand=hand_of(takes),
        facts=plain(
            {
                "takes": [
                    {"id": take.id, "name": take.name, "artifact": take.artifact}
                    | ({LEFT_OUT: take.left_out} if take.left_out else {})
                    for take in takes
                ],
                "held_out_rmse_deg": error.get("rmse_deg"),
                "rmse_unseen_wearing_deg": error.get("rmse_unseen_wearing_deg"),
                "held_out_how": error.get("how"),
                "per_rotation": {item.rotation: item.held_out_rmse_deg for item in model.rotations},
                "effects": list(dict.fromkeys(item.name for item in model.effects)),
                "simulated": model.simulated,
                "settings": asdict(settings),
                **facts,
                "sentences": [*dict.fromkeys((*incomplete_sentences(takes), *facts.get("sentences", ())))],
            }
        ),
    )
    if activate:
        store.models.activate(record.id)
    return record
