"""``takes/hands``: how far the clocks of two hands' takes are apart."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter
from pydantic import Field

from glovecal_models.takes.hand_clocks import HandAlignment, TakeClock, align
from glovecal_service.rest.http.answers import change_problems
from glovecal_service.rest.http.dependencies import StoreNeeded
from glovecal_service.rest.http.request_types import StrictBody, TakeReference
from glovecal_service.store.store import Store
from glovecal_service.views.hand_alignment import HandAlignmentView, hand_alignment_view

router = APIRouter(prefix="/takes/hands", tags=["takes"])


class HandsRequest(StrictBody):
    takes: Annotated[list[TakeReference], Field(min_length=2, max_length=2)]
    claps: bool = Field(False, description="Find an event that both gloves felt, and go by that.")


@router.post(
    "", response_model=HandAlignmentView, summary="Clocks of two hands", responses=change_problems(409)
)
def examine_hands(body: HandsRequest, store: StoreNeeded) -> dict[str, Any]:
    """By one capture computer, a time code, or wall clocks, as the takes' accounting says; or by claps."""
    return hand_alignment_view(*hand_alignment(store, body.takes[0], body.takes[1], claps=body.claps))


def hand_alignment(
    store: Store, first: str, second: str, *, claps: bool
) -> tuple[HandAlignment, tuple[TakeClock, TakeClock]]:
    """Of two stored takes. Raises NotFound, and BadInput where claps do not tell."""
    records = store.takes.get(first), store.takes.get(second)
    clocks = TakeClock.of_accounting(records[0].accounting), TakeClock.of_accounting(records[1].accounting)
    takes = [store.takes.load(record.id) for record in records]
    return align(takes[0], takes[1], clocks, claps=claps), clocks
