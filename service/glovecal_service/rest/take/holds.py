"""``takes/holds``: what readings do while a pose is held, without any model or measured angle."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter
from pydantic import BaseModel, Field

from glovecal_models.diagnosis.hold_drift import hold_drift
from glovecal_models.diagnosis.hold_drift_document import hold_document, hold_next_take
from glovecal_models.diagnosis.posed_holds import degrees_of_spans
from glovecal_models.errors import BadInput
from glovecal_models.takes.take import Take
from glovecal_service.plain import plain
from glovecal_service.rest.http.answers import change_problems
from glovecal_service.rest.http.dependencies import StoreNeeded
from glovecal_service.rest.http.request_types import Id, StrictBody

router = APIRouter(prefix="/takes/holds", tags=["takes"])

MOST_TAKES = 500


class HoldsRequest(StrictBody):
    takes: Annotated[list[Id], Field(min_length=1, max_length=MOST_TAKES)]


class SensorDrift(BaseModel):
    change_pct: float | None = Field(description="Mean change within a hold, percent of the sensor's span.")
    change_deg: float | None = Field(description="The same in degrees, where angles are known.")
    same_sign_holds: int


class HeldPoseView(BaseModel):
    pose: str
    holds: int
    duration_s: float
    tau_s: float = Field(description="Time constant of all holds of the pose.")
    tau_is_lower_bound: bool
    slowing_holds: int = Field(description="Holds whose drift slows down rather than speeds up.")
    sensors: dict[str, SensorDrift]


class NextTakeView(BaseModel):
    what: str
    seconds: int
    separates: list[str]


class HoldsView(BaseModel):
    sentence: str
    verdict: str = Field(description='"ambiguous", "named", "nothing" or "not_judgeable".')
    confidence_set: list[str] = Field(description="Causes that these holds cannot tell apart.")
    holds: int
    probability: float = Field(description="That holds which drift by chance drift so much alike.")
    drift_in_other_poses: float | None = Field(
        description="Speed in poses far away, as a share: warm-up 1, creep about 0 or negative."
    )
    recovery: float | None = Field(description="Share of the drift that is gone when the pose comes back.")
    poses: list[HeldPoseView]
    next_take: NextTakeView | None


@router.post(
    "", response_model=HoldsView, summary="How readings drift in held poses", responses=change_problems(409)
)
def examine_holds(body: HoldsRequest, store: StoreNeeded) -> dict[str, Any]:
    """Poses by their names, else by a reference of 0 and 1, else by still stretches with like readings."""
    wanted = list(dict.fromkeys(body.takes))
    takes = [store.takes.load(id) for id in wanted]
    _require_like_sensors(takes)
    layout = store.layouts.get(store.takes.get(wanted[0]).layout)
    drift = hold_drift(takes, layout.sensors, deg_of_span=degrees_of_spans(takes, layout))
    following = hold_next_take(drift)
    told = None
    if following is not None:
        told = {"what": following.what, "seconds": following.seconds, "separates": following.separates}
    return plain(hold_document(drift)) | {"next_take": plain(told)}


def _require_like_sensors(takes: list[Take]) -> None:
    for take in takes[1:]:
        if set(take.sensors) != set(takes[0].sensors):
            raise BadInput(
                f"take {take.name!r} has other sensors than {takes[0].name!r}; look at takes of one glove"
            )
