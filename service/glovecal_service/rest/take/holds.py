"""``takes/holds``: what readings do while a pose is held, without any model or measured angle."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter
from pydantic import Field

from glovecal_models.diagnosis.hold_drift import hold_drift
from glovecal_models.diagnosis.posed_holds import degrees_of_spans
from glovecal_models.errors import BadInput
from glovecal_models.takes.take import Take
from glovecal_service.rest.http.answers import change_problems
from glovecal_service.rest.http.dependencies import StoreNeeded
from glovecal_service.rest.http.request_types import Id, StrictBody
from glovecal_service.views.hold_drift import HoldsView

router = APIRouter(prefix="/takes/holds", tags=["takes"])

MOST_TAKES = 500


class HoldsRequest(StrictBody):
    takes: Annotated[list[Id], Field(min_length=1, max_length=MOST_TAKES)]


@router.post(
    "", response_model=HoldsView, summary="How readings drift in held poses", responses=change_problems(409)
)
def examine_holds(body: HoldsRequest, store: StoreNeeded) -> HoldsView:
    """Poses by their names, else by a reference of 0 and 1, else by still stretches with like readings."""
    wanted = list(dict.fromkeys(body.takes))
    takes = [store.takes.load(id) for id in wanted]
    _require_like_sensors(takes)
    layout = store.layouts.get(store.takes.get(wanted[0]).layout)
    drift = hold_drift(takes, layout.sensors, deg_of_span=degrees_of_spans(takes, layout))
    return HoldsView.of(drift)


def _require_like_sensors(takes: list[Take]) -> None:
    for take in takes[1:]:
        if set(take.sensors) != set(takes[0].sensors):
            raise BadInput(
                f"take {take.name!r} has other sensors than {takes[0].name!r}; look at takes of one glove"
            )
