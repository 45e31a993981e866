"""``audit``: who changed what."""

from __future__ import annotations

from fastapi import APIRouter

from glovecal_service.rest.access.answer import AuditCheck, AuditRow
from glovecal_service.rest.http.dependencies import StoreNeeded
from glovecal_service.rest.http.list_part import Searched
from glovecal_service.rest.http.problem import problems

router = APIRouter(prefix="/audit", tags=["access"])


@router.get("", summary="Who changed what", responses=problems())
def list_audit(store: StoreNeeded, paging: Searched) -> list[AuditRow]:
    """Newest first. What changes all the time and decides nothing is left out: how far a job is."""
    return [
        AuditRow(**{name: value for name, value in vars(one).items() if name != "previous"})
        for one in paging.answer(store.audit.page(paging.part))
    ]


@router.get("/check", summary="Whether the log of changes is what was written", responses=problems())
def check_audit(store: StoreNeeded) -> AuditCheck:
    """Every entry's hash, the one before it, and the end."""
    return AuditCheck(entries=store.audit.count, problems=store.audit.problems())
