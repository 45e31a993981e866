"""What endpoints ask for: the store, models ready to predict, and what lives with the application."""

from __future__ import annotations

import threading
from collections import OrderedDict
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated

import anyio
from fastapi import Depends, Request

from glovecal_models.calibration import artifact
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_service.camera.camera_access import CameraAccess
from glovecal_service.filming import Filming
from glovecal_service.rest.http.metrics import Metrics
from glovecal_service.rest.http.upload_folder import UploadFolder
from glovecal_service.settings import Settings
from glovecal_service.store.store import Store
from glovecal_service.store.videos import Videos

IMPORTS_AT_ONCE = 2
LONG_ANSWERS_AT_ONCE = 2
MOST_KEPT = 8
"""Models ready to predict: those used last."""


class Predictors:
    """Loads a model's artifact (verified by its sha256) when it is asked for the first time."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._kept: OrderedDict[str, tuple[CalibrationModel, GlovePredictor]] = OrderedDict()
        self._lock = threading.Lock()
        self.one_at_a_time = threading.Lock()
        """Held while predicting: a predictor keeps work arrays, and requests run in several threads."""

    def get(self, id: str) -> tuple[CalibrationModel, GlovePredictor]:
        """By full id. Raises NotFound, DamagedArtifact."""
        with self._lock:
            if id in self._kept:
                self._kept.move_to_end(id)
                return self._kept[id]
        model = artifact.load(self._store.models.load_bytes(id), expected_id=id)
        ready = (model, GlovePredictor(model))
        with self._lock:
            self._kept[id] = ready
            while len(self._kept) > MOST_KEPT:
                self._kept.popitem(last=False)
        return ready


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
    answer_slots: anyio.CapacityLimiter = field(
        default_factory=lambda: anyio.CapacityLimiter(LONG_ANSWERS_AT_ONCE)
    )
    """The same for answers that are worked out in a process of their own."""

    @cached_property
    def filming(self) -> Filming:
        return Filming(self.settings.films_folder)

    @cached_property
    def cameras(self) -> CameraAccess:
        return CameraAccess(self.settings.zenoh)

    @property
    def videos(self) -> Videos:
        return Videos(self.settings.videos_folder)


def _parts(request: Request) -> Parts:
    return request.app.state.parts


def _store(request: Request) -> Store:
    return request.app.state.parts.store


PartsNeeded = Annotated[Parts, Depends(_parts)]
StoreNeeded = Annotated[Store, Depends(_store)]
