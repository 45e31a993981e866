"""The frames of one turn with their model's effects: predicted together, corrected one by one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_client.wire.frame import Frame
from glovecal_models.calibration.doubt import Doubt
from glovecal_models.calibration.predictor import GloveAngles
from glovecal_service.realtime.glove_lane import GloveLane
from glovecal_service.realtime.served_model import ServedModel
from glovecal_service.realtime.worn_gloves import WornGloves


def corrected(
    model: ServedModel, opened: Sequence[tuple[GloveLane, Frame, int]], angles: GloveAngles, worn: WornGloves
) -> tuple[GloveAngles, list[int]]:
    """``angles`` of the ``opened`` frames with the effects, and flags for each pose.

    Frames of a glove must be in order; those of several gloves may be mixed.
    """
    flags = [0] * len(opened)
    if not model.predictor.has_effects:
        for lane, _, _ in opened:
            lane.effects = None
        return angles, flags
    correction = np.zeros_like(angles.mean)
    undefined = np.zeros(correction.shape, dtype=bool)
    doubt: Doubt | None = None
    finite: list[bool] = np.all(np.isfinite(angles.mean), axis=1).tolist()
    for row, (lane, frame, _) in enumerate(opened):
        # What is no number gets no pose, and must not get into a state either.
        if finite[row]:
            effects = lane.effects_of(model)
            found = effects.correct(frame, worn.of(lane.glove), angles.mean[row])
            correction[row], flags[row] = found.degrees, found.flags
            if found.undefined is not None:
                undefined[row] = found.undefined
            if found.doubt is not None:
                doubt = doubt or Doubt(np.zeros_like(angles.mean), np.zeros(correction.shape, dtype=bool))
                doubt.variance[row], doubt.is_faulty[row] = found.doubt
    return model.predictor.corrected(angles, correction, undefined, doubt), flags
