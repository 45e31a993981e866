"""What endpoints ask for: the store and the other parts that live as long as the application."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

import anyio
from fastapi import Depends, Request

from glovecal_service.rest.http.metrics import Metrics
from glovecal_service.rest.http.predictors import Predictors
from glovecal_service.rest.http.upload_folder import UploadFolder
from glovecal_service.settings import Settings
from glovecal_service.store.store import Store

IMPORTS_AT_ONCE = 2


@dataclass
class Parts:
    """Everything the routers share; made by the application's lifespan."""

    settings: Settings
    store: Store
    uploads: UploadFolder
    metrics: Metrics
    predictors: Predictors
    import_slots: anyio.CapacityLimiter = field(
        default_factory=lambda: anyio.CapacityLimiter(IMPORTS_AT_ONCE)
    )
    """Tables are parsed in memory: so many at once and no more, the others wait."""


def _parts(request: Request) -> Parts:
    return request.app.state.parts


def _store(request: Request) -> Store:
    return request.app.state.parts.store


PartsNeeded = Annotated[Parts, Depends(_parts)]
StoreNeeded = Annotated[Store, Depends(_store)]
