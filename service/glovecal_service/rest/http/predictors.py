"""Calibration models ready to predict: the few used last are kept."""

from __future__ import annotations

import threading
from collections import OrderedDict

from glovecal_models.calibration import artifact
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_service.store.store import Store

MOST_KEPT = 8


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
