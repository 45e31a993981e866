"""What a model was made from, and simpler calibrations of the same takes: the scale of its error."""

from __future__ import annotations

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_service.jobs.model_work import trained_ids
from glovecal_service.rest.http.dependencies import Parts
from glovecal_service.store.records import ModelRecord


def versions_before(
    parts: Parts, record: ModelRecord
) -> tuple[list[CalibrationModel], dict[str, CalibrationModel]]:
    """Ancestors, oldest first, and calibrations by method; both empty for a first version.

    Raises DamagedArtifact, NotFound.
    """
    older = parts.store.models.lineage(record.id)[:0:-1]
    if not older:
        return [], {}
    ancestors = [parts.predictors.get(item.id)[0] for item in older]
    methods = {model.method for model in ancestors}
    takes = [parts.store.takes.load(id) for id in trained_ids(parts.store, older[0])]
    layout = ancestors[0].layout
    simpler = {
        method: train(takes, layout, record.subject, TrainingSettings(method=method, folds=0))
        for method in ("raw", "linear")
        if method not in methods
    }
    return ancestors, simpler
