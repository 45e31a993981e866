"""``health`` and ``metrics``: whether the process lives and can do its work, and numbers for Prometheus."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import Literal

from fastapi import APIRouter, Response
from prometheus_client import CONTENT_TYPE_LATEST
from pydantic import BaseModel, Field

from glovecal_service.rest.http.answers import problems
from glovecal_service.rest.http.dependencies import PartsNeeded
from glovecal_service.rest.http.problem import Problem
from glovecal_service.store.errors import StoreDamaged, StoreError
from glovecal_service.store.store import Store

router = APIRouter(tags=["health"])

REALTIME_ALIVE = "realtime.alive"
"""A file in the data folder that the real-time process touches once a second."""
SEEN_WITHIN_S = 5.0
LEAST_FREE_BYTES = 50_000_000


class Live(BaseModel):
    status: Literal["alive"] = "alive"


class Ready(BaseModel):
    status: Literal["ready"] = "ready"
    database: str
    artifacts: str
    realtime: Literal["seen", "not seen"] = Field(
        description="The real-time process is restarted by itself; REST works without it."
    )
    realtime_seen_s_ago: float | None
    problems: list[str] = Field(
        description="What does not keep the service from working, such as a damaged active model: what to do."
    )


@router.get("/health/live", summary="The process answers", responses=problems())
def live() -> Live:
    return Live()


@router.get("/health/ready", summary="Database and artifacts work", responses=problems(507))
def ready(parts: PartsNeeded, response: Response) -> Ready:
    """503 or 507 with a sentence when they do not."""
    response.headers["Cache-Control"] = "no-store"
    _check_database(parts.store)
    seen = _seconds_since(parts.settings.data / REALTIME_ALIVE)
    return Ready(
        database=parts.store.database.engine.dialect.name,
        artifacts=_check_artifacts(parts.store, parts.settings.data),
        realtime="seen" if seen is not None and seen <= SEEN_WITHIN_S else "not seen",
        realtime_seen_s_ago=seen,
        problems=_problems(parts.store),
    )


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


def _check_database(store: Store) -> None:
    try:
        store.subjects.list()
    except StoreError as error:
        raise Problem(503, "not-ready", f"the database does not work: {error}") from error


def _check_artifacts(store: Store, data: Path) -> str:
    try:
        store.artifacts.exists("0" * 64)
    except (StoreError, OSError) as error:
        raise Problem(503, "not-ready", f"the artifacts cannot be reached: {error}") from error
    if not os.access(data, os.W_OK):
        raise Problem(503, "not-ready", "the data folder cannot be written to")
    disk = os.statvfs(data)
    free = disk.f_bavail * disk.f_frsize
    if free < LEAST_FREE_BYTES:
        raise Problem(507, "storage-full", f"only {free / 1e6:.0f} MB are free; free some disk space")
    return f"{free / 1e9:.1f} GB free"


def _problems(store: Store) -> list[str]:
    try:
        return [damage for model in store.models.all_active() if (damage := store.models.damage(model))]
    except StoreDamaged as error:
        return [str(error)]


def _seconds_since(path: Path) -> float | None:
    try:
        return round(max(0.0, time.time() - path.stat().st_mtime), 1)
    except OSError:
        return None
