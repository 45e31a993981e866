"""``health`` and ``metrics``: whether the process lives and can do its work, and numbers for Prometheus."""

from __future__ import annotations

import os
import shutil
import time
from pathlib import Path
from typing import Literal

from fastapi import APIRouter, Response
from prometheus_client import CONTENT_TYPE_LATEST
from pydantic import BaseModel, Field

from glovecal_service.plain import reason_of
from glovecal_service.rest.http.answers import problems
from glovecal_service.rest.http.dependencies import Parts, PartsNeeded
from glovecal_service.rest.http.problem import Problem
from glovecal_service.restarts import AWAY_TIMES, AWAY_WITHIN_S, TOLD_FOR_S, Restarts
from glovecal_service.store.blobs import LEAST_FREE_BYTES
from glovecal_service.store.errors import StoreDamaged, StoreError
from glovecal_service.store.store import Store

router = APIRouter(tags=["health"])

REALTIME_ALIVE = "realtime.alive"
"""A file in the data folder that the real-time process touches once a second."""
SEEN_WITHIN_S = 5.0


class Live(BaseModel):
    status: Literal["alive"] = "alive"


class Storage(BaseModel):
    database: str
    artifacts: str


class Ready(Storage):
    status: Literal["ready"] = "ready"
    realtime_seen_s_ago: float
    realtime_restarts: int = Field(description="In the last 10 minutes; 503 after three within one.")
    problems: list[str] = Field(
        description="What does not keep the service from working, such as a damaged active model: what to do."
    )


@router.get("/health/live", summary="The process answers", responses=problems())
def live() -> Live:
    return Live()


@router.get(
    "/health/ready", summary="Gloves are served: database, artifacts and real time work",
    responses=problems(507),
)  # fmt: skip
def ready(parts: PartsNeeded, response: Response) -> Ready:
    """503 or 507 with a sentence when they do not; the rest of REST answers without real time, too."""
    response.headers["Cache-Control"] = "no-store"
    storage = working_storage(parts)
    seen_s_ago = realtime_seen_s_ago(parts)
    if seen_s_ago is None or seen_s_ago > SEEN_WITHIN_S:
        raise Problem(503, "not-ready", _no_realtime(seen_s_ago))
    restarts = Restarts(parts.settings.data)
    if restarts.within(AWAY_WITHIN_S) >= AWAY_TIMES:
        raise Problem(503, "not-ready", f"gloves are served with interruptions: {restarts.sentence()}")
    told = [sentence for sentence in (restarts.sentence(),) if sentence]
    return Ready(
        **storage.model_dump(),
        realtime_seen_s_ago=seen_s_ago,
        realtime_restarts=restarts.within(TOLD_FOR_S),
        problems=[*told, *_problems(parts.store)],
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


def working_storage(parts: Parts) -> Storage:
    """Raises Problem when database or artifacts do not work."""
    _check_database(parts.store)
    return Storage(
        database=parts.store.database.engine.dialect.name,
        artifacts=_check_artifacts(parts.store, parts.settings.data),
    )


def realtime_seen_s_ago(parts: Parts) -> float | None:
    """Seconds; None: never."""
    try:
        seen = (parts.settings.data / REALTIME_ALIVE).stat().st_mtime
    except OSError:
        return None
    return round(max(0.0, time.time() - seen), 1)


def _no_realtime(seen_s_ago: float | None) -> str:
    seen = "was never seen" if seen_s_ago is None else f"was last seen {seen_s_ago:.0f} s ago"
    return f"no glove is served: the real-time process {seen}; glovecal serve's log says why"


def _check_database(store: Store) -> None:
    try:
        store.subjects.list()
    except StoreError as error:
        raise Problem(503, "not-ready", f"the database does not work: {error}") from error


def _check_artifacts(store: Store, data: Path) -> str:
    try:
        store.artifacts.exists("0" * 64)
    except (StoreError, OSError) as error:
        raise Problem(503, "not-ready", f"the artifacts cannot be reached: {reason_of(error)}") from error
    if not os.access(data, os.W_OK):
        raise Problem(503, "not-ready", "the data folder cannot be written to")
    free = shutil.disk_usage(data).free
    if free < LEAST_FREE_BYTES:
        raise Problem(507, "storage-full", f"only {free / 1e6:.0f} MB are free; free some disk space")
    return f"{free / 1e9:.1f} GB free"


def _problems(store: Store) -> list[str]:
    try:
        return [damage for model in store.models.all_active() if (damage := store.models.damage(model))]
    except StoreDamaged as error:
        return [str(error)]
