"""A take as a hand's motion: raw, or predicted by a model."""

from __future__ import annotations

import numpy as np

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.predictor import FAULTY_SENSOR, TOO_UNCERTAIN, GlovePredictor
from glovecal_models.calibration.samples import require_layout
from glovecal_models.hand.skeleton import Skeleton
from glovecal_models.takes.take import Take
from glovecal_service.exports.hand_motion import HandMotion


def motion_of(take: Take, model: CalibrationModel | None, skeleton: Skeleton, label: str) -> HandMotion:
    """From where the take was asked for; its pre-roll only tells effects with a memory where they stand.

    Angles that are too uncertain, or read from a sensor that fails, are NaN. Raises LayoutMismatch.
    """
    asked = np.ones(len(take.time_s), bool) if take.begins_s is None else take.time_s >= take.begins_s
    count = int(asked.sum())
    rotations: tuple[str, ...] = ()
    degrees = sd_deg = np.empty((count, 0))
    if model is not None:
        require_layout(take, model.layout)
        predictor = GlovePredictor(model)
        columns = [take.sensors.index(name) for name in model.layout.sensors]
        found = predictor.predict_take(take.time_s, take.readings[:, columns], take.context, take.wearing)
        unusable = (found.flags & (TOO_UNCERTAIN | FAULTY_SENSOR)) > 0
        rotations = predictor.rotations
        degrees = np.where(unusable, np.nan, found.mean)[asked]
        sd_deg = np.where(unusable, np.nan, found.sd)[asked]
    return HandMotion(
        label, take.time_s[asked], take.sensors, take.readings[asked], rotations, degrees, sd_deg, skeleton,
        take.simulated,
    )  # fmt: skip
