"""What endpoints ask for: the store, models ready to predict, and what lives with the application."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Annotated

import anyio
from fastapi import Depends, Request

from glovecal_service.camera.started_cameras import CameraAccess
from glovecal_service.filming import Filming
from glovecal_service.first_run.simulated_glove import StreamedGlove
from glovecal_service.questions.at_once import Predictors
from glovecal_service.rest.http.guesses import Guesses
from glovecal_service.rest.http.observation import Metrics
from glovecal_service.rest.http.provider import Provider
from glovecal_service.rest.http.upload_folder import UploadFolder
from glovecal_service.settings import Settings
from glovecal_service.store.store import Store
from glovecal_service.store.take_file import Videos

IMPORTS_AT_ONCE = 2
LONG_ANSWERS_AT_ONCE = 2


@dataclass
class Parts:
    """Everything the routers share; made by the application's lifespan. A request has a copy of its own whose
    store is that of who asks."""

    settings: Settings
    store: Store
    uploads: UploadFolder
    metrics: Metrics
    predictors: Predictors
    filming: Filming
    cameras: CameraAccess
    streamed_glove: StreamedGlove
    provider: Provider | None
    """Whose people may log in beside those who are known here."""
    import_slots: anyio.CapacityLimiter = field(
        default_factory=lambda: anyio.CapacityLimiter(IMPORTS_AT_ONCE)
    )
    """Tables are parsed in memory: so many at once and no more, the others wait."""
    answer_slots: anyio.CapacityLimiter = field(
        default_factory=lambda: anyio.CapacityLimiter(LONG_ANSWERS_AT_ONCE)
    )
    """The same for answers that are worked out in a process of their own."""
    guesses: Guesses = field(default_factory=Guesses)
    """Who checks or makes a password waits here."""

    @property
    def videos(self) -> Videos:
        return Videos(self.store.files)


def _store(request: Request) -> Store:
    """As who asks sees it: what they do not see is not there, and changes are theirs."""
    return request.app.state.parts.store.acting_as(request.state.actor)


def _parts(request: Request) -> Parts:
    return replace(request.app.state.parts, store=_store(request))


PartsNeeded = Annotated[Parts, Depends(_parts)]
StoreNeeded = Annotated[Store, Depends(_store)]
