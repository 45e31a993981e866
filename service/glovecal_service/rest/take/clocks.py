"""``takes/clocks``: do the clocks of glove and reference agree, and what to do when they do not."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated, Any

from fastapi import APIRouter
from pydantic import Field

from glovecal_models.takes.answer import TakeClock
from glovecal_models.takes.clock_scan import clock_offsets
from glovecal_service.plain import plain
from glovecal_service.request_types import Id, StrictBody
from glovecal_service.rest.http.dependencies import StoreNeeded
from glovecal_service.rest.http.problem import change_problems
from glovecal_service.store.takes import CLOCK_OFFSET

router = APIRouter(prefix="/takes/clocks", tags=["takes"])

MOST_TAKES = 500


class Wanted(StrictBody):
    takes: Annotated[list[Id], Field(min_length=1, max_length=MOST_TAKES)]


class ClocksRequest(Wanted):
    repair: bool = Field(False, description="Move each reference whose clock is found to be off.")


@router.post(
    "", response_model=list[TakeClock], summary="Examine reference clocks", responses=change_problems(409)
)
def examine_clocks(body: ClocksRequest, store: StoreNeeded) -> list[dict[str, Any]]:
    """Takes of one wearing are judged together. A repair keeps the take's id, and can be undone. A reference
    whose clock is not found stays as it is, and every result that uses it says so."""
    wanted = list(dict.fromkeys(body.takes))
    found = clock_offsets([store.takes.load(id) for id in wanted])
    answers, any_off = [], any(clock.verdict == "offset" for clock in found)
    for id, clock in zip(wanted, found, strict=True):
        repaired = body.repair and clock.verdict == "offset"
        if repaired:
            store.takes.shift_reference(id, -clock.offset_s)
        if body.repair:
            store.takes.note_clock(id, unknown=any_off and clock.is_unknown)
        answers.append(plain(asdict(clock)) | {"id": id, "repaired": repaired})
    return answers


@router.post("/undo", response_model=list[str], summary="Undo repairs", responses=change_problems(409))
def undo_repairs(body: Wanted, store: StoreNeeded) -> list[str]:
    """Move references back to where they were; the ids of takes that changed."""
    changed = []
    for id in dict.fromkeys(body.takes):
        store.takes.note_clock(id, unknown=False)
        offset = store.takes.get(id).facts.get(CLOCK_OFFSET, 0.0)
        if offset:
            store.takes.shift_reference(id, offset)
            changed.append(id)
    return changed
