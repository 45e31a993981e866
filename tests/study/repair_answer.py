"""How far the error falls once the right effect is added, against the same glove without any effect.

The name is given here, so that a failure of this part is one of learning, not of naming. All errors are those
on takes left out; the twin has the same hand, motion and noise.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from blind_glove import BlindGlove
from repair_constants import repair_constants

from glovecal_models.calibration.held_out_check import HeldOutErrors, held_out_errors
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.calibration.prepared_takes import PreparedTakes
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.errors import BadInput
from glovecal_models.improvement.add_effect import add_effect
from glovecal_models.improvement.limits import IMPROVEMENT_LIMITS, ImprovementLimits
from glovecal_models.improvement.text import addition_sentence

SAMPLES = 300
"""Representative frames: joints of one sensor reach the floor with so many, in seconds."""
WITHIN_SD = 1.959964
"""Of the interval that is to cover 95 % of new measurements."""


def training_settings(glove: BlindGlove, folds: int = 3) -> TrainingSettings:
    return TrainingSettings("linear" if glove.linear else "lmc_gpr", samples=SAMPLES, folds=folds)


def repair_answer(glove: BlindGlove, limits: ImprovementLimits = IMPROVEMENT_LIMITS) -> dict[str, Any]:
    """RMSE over the affected joints, degrees: before, after, and the clean twin's."""
    settings = training_settings(glove)
    model = train(glove.takes, glove.layout, "study", training_settings(glove, folds=0))
    rotations = affected_rotations(glove)
    bent = replace(settings, method="lmc_gpr")  # a straight line would leave the twin its own mild curve
    twin = held_out_errors(PreparedTakes.of(glove.clean_takes, glove.layout), rotations, (), bent)
    constants = repair_constants(glove, rotations)
    told = {"rotations": list(rotations), "twin_deg": _rmse(twin, rotations), **glove.told()}
    try:
        addition = add_effect(
            model,
            glove.takes,
            glove.truth,
            rotations=rotations,
            constants=constants,
            settings=settings,
            limits=limits,
        )
    except BadInput as problem:
        return told | {"added": False, "sentence": str(problem)}
    return told | {
        "added": addition.added,
        "sentence": addition_sentence(addition),
        "before_deg": _rmse(addition.before, rotations),
        "after_deg": _rmse(addition.after, rotations),
        "covered": _covered(glove, addition.model, rotations),
    }


def affected_rotations(glove: BlindGlove) -> tuple[str, ...]:
    """Joints whose own sensor has the cause."""
    channels = {name for item in glove.session.causes[: len(glove.causes)] for name in item.channels}
    return tuple(name for name in glove.layout.rotations if name in channels)


def _rmse(errors: HeldOutErrors, rotations: tuple[str, ...]) -> float:
    square = sum(errors.square[name] for name in rotations)
    return round(float(np.sqrt(square / max(sum(errors.count[name] for name in rotations), 1))), 4)


def _covered(glove: BlindGlove, model: CalibrationModel, rotations: tuple[str, ...]) -> float:
    """Share of a new take's measurements inside the 95 % interval."""
    take = glove.session.also("natural", 40.0, 0).take
    angles = GlovePredictor(model).predict_take(take.time_s, take.readings, take.context, take.wearing)
    reference = take.reference_at_frames(model.rotation_names)
    columns = [model.rotation_names.index(name) for name in rotations]
    error = np.abs(angles.mean - reference)[:, columns]
    known = np.isfinite(error)
    return round(float(np.mean((error <= WITHIN_SD * angles.sd[:, columns])[known])), 4)
