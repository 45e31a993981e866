"""``takes/hands``: how far the clocks of two hands' takes are apart."""

from __future__ import annotations

import math
from typing import Annotated

from fastapi import APIRouter
from pydantic import Field

from glovecal_models.takes.hand_clocks import HandAlignment, TakeClock, align
from glovecal_models.takes.text import alignment_sentence
from glovecal_service.request_types import StrictBody, TakeReference
from glovecal_service.rest.http.dependencies import StoreNeeded
from glovecal_service.rest.http.problem import change_problems
from glovecal_service.rest.take.answer import HandAlignmentView, OwnClockView
from glovecal_service.store.store import Store


def _view(found: HandAlignment, clocks: tuple[TakeClock, TakeClock]) -> HandAlignmentView:
    """What is not known is None."""
    own = [None if clock.own is None else OwnClockView.model_validate(clock.own) for clock in clocks]
    known = {name: getattr(found, name) for name in ("how", "shift_s", "at_s")}
    return HandAlignmentView(
        **known,
        drift_ppm=1e6 * found.drift,
        sd_s=None if math.isnan(found.sd_s) else found.sd_s,
        own_clocks=own,
        sentence=alignment_sentence(found, clocks),
    )


router = APIRouter(prefix="/takes/hands", tags=["takes"])


class HandsRequest(StrictBody):
    takes: Annotated[list[TakeReference], Field(min_length=2, max_length=2)]
    claps: bool = Field(False, description="Find an event that both gloves felt, and go by that.")


@router.post(
    "", response_model=HandAlignmentView, summary="Clocks of two hands", responses=change_problems(409)
)
def examine_hands(body: HandsRequest, store: StoreNeeded) -> HandAlignmentView:
    """By one capture computer, a time code, or wall clocks, as the takes' accounting says; or by claps."""
    return _view(*hand_alignment(store, body.takes[0], body.takes[1], claps=body.claps))


def hand_alignment(
    store: Store, first: str, second: str, *, claps: bool
) -> tuple[HandAlignment, tuple[TakeClock, TakeClock]]:
    """Of two stored takes. Raises NotFound, and BadInput where claps do not tell."""
    records = store.takes.get(first), store.takes.get(second)
    clocks = TakeClock.of_accounting(records[0].accounting), TakeClock.of_accounting(records[1].accounting)
    takes = [store.takes.load_recorded(record.id) for record in records]
    return align(takes[0], takes[1], clocks, claps=claps), clocks
