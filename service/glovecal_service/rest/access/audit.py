"""``audit``: who changed what."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query

from glovecal_service.rest.access.answer import AuditCheck, AuditRow
from glovecal_service.rest.http.dependencies import StoreNeeded
from glovecal_service.rest.http.problem import problems

router = APIRouter(prefix="/audit", tags=["access"])
MOST_AT_ONCE = 1000


@router.get("", summary="Who changed what", responses=problems())
def list_audit(
    store: StoreNeeded,
    limit: Annotated[int, Query(ge=1, le=MOST_AT_ONCE)] = 100,
    before: Annotated[int | None, Query(ge=1, le=2**53, description="Entries older than this id.")] = None,
) -> list[AuditRow]:
    """Newest first. What changes all the time and decides nothing is left out: how far a job is."""
    entries = store.audit.list(limit=limit, before=before)
    return [
        AuditRow(**{name: value for name, value in vars(one).items() if name != "previous"})
        for one in entries
    ]


@router.get("/check", summary="Whether the log of changes is what was written", responses=problems())
def check_audit(store: StoreNeeded) -> AuditCheck:
    """Every entry's hash, the one before it, and the end."""
    return AuditCheck(entries=store.audit.count, problems=store.audit.problems())
