"""``models/train``: a calibration model from takes, as a job."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Response
from pydantic import Field, field_validator

from glovecal_models.calibration.training_settings import Method
from glovecal_models.errors import BadInput, LayoutMismatch, NotTrainable
from glovecal_models.hand.handedness import Handedness
from glovecal_service.jobs.training_takes import require_one_hand
from glovecal_service.rest.http.answers import change_problems
from glovecal_service.rest.http.dependencies import StoreNeeded
from glovecal_service.rest.http.request_types import Id, Identifier, ModelReference, StrictBody, SubjectName
from glovecal_service.rest.job.jobs import Job, new_job
from glovecal_service.store.errors import Conflict
from glovecal_service.store.records import JobRecord, ModelRecord, TakeRecord
from glovecal_service.store.store import Store

router = APIRouter(prefix="/models", tags=["models"])

MOST_TAKES = 1000


class Training(StrictBody):
    subject: SubjectName
    layout: Identifier | None = Field(None, description="None: that of the takes, if it is one.")
    hand: Handedness | None = Field(
        None,
        description="Only its takes, and those of which nobody said it; needed where there are both hands'.",
    )
    method: Method = Field("lmc_gpr", description="`auto` chooses a kernel for each rotation.")
    takes: Annotated[list[Id], Field(min_length=1, max_length=MOST_TAKES)] | None = Field(
        None,
        description="None: all takes of the subject (and layout) that have a "
        "reference, or in which fingertips were kept together.",
    )
    activate: bool = Field(True, description="Predict live with the model once it is trained.")
    pseudo_inputs: Annotated[int, Field(ge=2, le=1000)] = Field(100, description="SPGP only.")
    parent: ModelReference | None = None
    prior: ModelReference | None = Field(
        None, description="A linear model of the same glove: LMC-GPR's mean where samples say nothing."
    )
    samples: Annotated[int, Field(ge=10, le=5000)] = Field(2000, description="At most, for one rotation.")
    folds: Annotated[int, Field(ge=0, le=20)] = Field(3, description="Held-out folds; 0: no error estimate.")
    iterations: Annotated[int, Field(ge=1, le=2000)] = Field(200, description="SPGP only.")
    seed: Annotated[int, Field(ge=0, le=2**31 - 1)] = 0
    keep_dead: bool = Field(
        False, description="Keep sensors that never move in the takes, or are clipped: they are refused."
    )

    @field_validator("folds")
    @classmethod
    def _not_one(cls, folds: int) -> int:
        if folds == 1:
            raise BadInput("one fold would hold out everything; 0 or at least 2")
        return folds


@router.post(
    "/train",
    status_code=202,
    response_model=Job,
    summary="Train a calibration model",
    responses=change_problems(409),
)
def train(body: Training, store: StoreNeeded, response: Response) -> JobRecord:
    """Answers at once with the job; what cannot be trained is refused here, before anything is fitted."""
    store.subjects.get(body.subject)
    if body.layout is not None:
        store.layouts.get(body.layout)
    takes = _chosen_takes(store, body)
    chosen = {"layout": takes[0].layout, "takes": [take.id for take in takes]}
    payload: dict[str, Any] = body.model_dump(exclude={"hand"}) | chosen
    if body.parent is not None:
        payload["parent"] = store.models.get(body.parent).id
    if body.prior is not None:
        payload["prior"] = _prior(store, body).id
    return new_job(store, response, "train", payload, body.subject)


def _prior(store: Store, body: Training) -> ModelRecord:
    prior = store.models.get(body.prior or "")
    if prior.subject != body.subject:
        raise Conflict(f"model {prior.id} is of subject {prior.subject!r}, not {body.subject!r}")
    if body.method != "lmc_gpr":
        raise NotTrainable(f"a prior mean is for method lmc_gpr, not for {body.method}")
    return prior


def _chosen_takes(store: Store, body: Training) -> list[TakeRecord]:
    if body.takes is None:
        every = store.takes.list(subject=body.subject, layout=body.layout)
        takes = [take for take in every if take.teaches_by(body.method) and take.is_of(body.hand)]
    else:
        takes = [store.takes.get(id) for id in dict.fromkeys(body.takes)]
    for take in takes:
        if take.subject != body.subject:
            raise Conflict(
                f"take {take.id} ({take.name!r}) is of subject {take.subject!r}, not {body.subject!r}"
            )
        if body.layout not in (None, take.layout):
            raise LayoutMismatch(
                f"take {take.id} ({take.name!r}) has layout {take.layout!r}, not {body.layout!r}"
            )
    if not any(take.teaches_by(body.method) for take in takes):
        of_layout = f" with layout {body.layout!r}" if body.layout is not None else ""
        raise NotTrainable(
            f"no take of subject {body.subject!r}{of_layout} has reference angles; "
            "import some with r.ROTATION columns, or attach a reference to a recording"
        )
    require_one_hand(takes)
    layouts = sorted({take.layout for take in takes})
    if len(layouts) > 1:
        raise LayoutMismatch(f"the takes have layouts {', '.join(layouts)}; choose one of them as layout")
    return takes
