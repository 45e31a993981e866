"""A model that was made from another one: what is written beside its artifact."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from glovecal_models.calibration.artifact import dump, load
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_service.plain import plain
from glovecal_service.store import Store
from glovecal_service.store.records import ModelRecord, TakeRecord, hand_of, incomplete_sentences


def artifact_array(model: CalibrationModel) -> np.ndarray:
    """A model's bytes in the form in which a task hands them back."""
    return np.frombuffer(dump(model), np.uint8)


def keep_child(
    store: Store,
    artifact: np.ndarray,
    layout: str,
    takes: Sequence[TakeRecord],
    settings: TrainingSettings,
    facts: dict[str, Any],
    *,
    activate: bool = False,
) -> ModelRecord:
    """Store a model that a task made; ``facts`` go beside those that every model has."""
    content = artifact.tobytes()
    model = load(content)
    record = store.models.add(
        content,
        subject=model.subject,
        layout=layout,
        method=model.method,
        parent=model.parent,
        hand=hand_of(takes),
        facts=plain(
            {
                "takes": [{"id": take.id, "name": take.name, "artifact": take.artifact} for take in takes],
                "held_out_rmse_deg": model.error_estimate.get("rmse_deg"),
                "rmse_unseen_wearing_deg": model.error_estimate.get("rmse_unseen_wearing_deg"),
                "held_out_how": model.error_estimate.get("how"),
                "per_rotation": {item.rotation: item.held_out_rmse_deg for item in model.rotations},
                "effects": list(dict.fromkeys(item.name for item in model.effects)),
                "simulated": model.simulated,
                "settings": asdict(settings),
                **facts,
                "sentences": [*incomplete_sentences(takes), *facts.get("sentences", ())],
            }
        ),
    )
    if activate:
        store.models.activate(record.id)
    return record
