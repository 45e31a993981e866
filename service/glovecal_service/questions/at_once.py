"""A question that is answered by its request: its routes and its page follow from it (``rest/asking.py``)."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, Literal, TypeVar

from pydantic import BaseModel

from glovecal_models.presentation.document import Answer
from glovecal_service.plain import read
from glovecal_service.store.records import ModelRecord
from glovecal_service.store.store import Store

if TYPE_CHECKING:
    from glovecal_models.calibration.model import CalibrationModel
    from glovecal_models.calibration.predictor import GlovePredictor

Request = TypeVar("Request", bound=BaseModel)
Found = TypeVar("Found", bound=Answer)
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
        from glovecal_models.calibration import artifact  # slow to load, and most commands open no model
        from glovecal_models.calibration.predictor import GlovePredictor

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


@dataclass(frozen=True)
class AskedAtOnce(Generic[Request]):
    """A request, and what its answer is made of."""

    request: Request
    store: Store
    predictors: Predictors
    record: ModelRecord | None = None
    """None where it is asked of takes."""

    @property
    def model(self) -> ModelRecord:
        assert self.record is not None
        return self.record


@dataclass(frozen=True)
class AtOnce(Generic[Request, Found]):
    """One question about takes, or about a model, that takes about a second."""

    kind: str
    """The end of its address."""
    of: Literal["takes", "model"]
    summary: str
    """One line, for a list of routes."""
    help: str
    request: type[Request]
    answer: type[Found]
    run: Callable[[AskedAtOnce[Request]], Found]
    """Raises what makes a problem document."""
    verb: str | None = None
    """None: it has one of its own."""
    has_page: bool = False
    """Whether ``.../report`` shows it with pictures."""

    def read(self, document: Any) -> Found:
        """The answer from its document. Raises pydantic.ValidationError."""
        return read(self.answer, document)
