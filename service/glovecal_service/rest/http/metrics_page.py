"""``metrics``: numbers for Prometheus."""

from __future__ import annotations

from fastapi import APIRouter, Response
from prometheus_client import CONTENT_TYPE_LATEST

from glovecal_service.rest.http.answers import problems
from glovecal_service.rest.http.dependencies import PartsNeeded

router = APIRouter(tags=["health"])


@router.get(
    "/metrics",
    response_class=Response,
    summary="Numbers for Prometheus",
    responses=problems()
    | {200: {"description": "Text format.", "content": {"text/plain": {"schema": {"type": "string"}}}}},
)
def metrics(parts: PartsNeeded) -> Response:
    counts = parts.store.jobs.unfinished()
    for state in ("queued", "running"):
        parts.metrics.jobs.labels(state).set(counts.get(state, 0))
    return Response(parts.metrics.text(), media_type=CONTENT_TYPE_LATEST)
