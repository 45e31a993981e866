"""How far the error falls once the right effect is added, against the same glove without any effect.

The name is given here, so that a failure of this part is one of learning, not of naming. All errors are those
on takes left out; the twin has the same hand, motion and noise.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from blind_glove import BlindGlove
from calibration_settings import training_settings
from ceiling_answer import ceiling_of
from repair_constants import repair_constants

from glovecal_models.calibration.leave_out import HeldOutErrors, held_out_errors
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.calibration.prepared_takes import PreparedTakes
from glovecal_models.calibration.training import train
from glovecal_models.errors import BadInput
from glovecal_models.improvement.add_effect import add_effect
from glovecal_models.improvement.limits import IMPROVEMENT_LIMITS, ImprovementLimits

WITHIN_SD = 1.959964
"""Of the interval that is to cover 95 % of new measurements."""
COVERAGE = ("saturation", "garment_slip", "sensor_fault")
"""Effects that lose the angle: the interval has to say so, the error cannot fall to the clean twin's."""
CLOSE_TO_TWIN = 1.1
"""Times the clean twin's error. Above it the ceiling says whether anything is left to gain: a sensor that
lost the angle cannot be brought back to its twin."""
REMEMBERING = ("creep", "hysteresis", "lag")
"""Where the glove was before the first frame is not in a take without a pre-roll: there the black-box ceiling
says what could be gained from what was recorded."""


def repair_answer(glove: BlindGlove, limits: ImprovementLimits = IMPROVEMENT_LIMITS) -> dict[str, Any]:
    """RMSE over the affected joints, degrees: before, after, and the clean twin's."""
    settings, takes = training_settings(glove), glove.takes
    model = train(takes, glove.layout, "study", training_settings(glove, folds=0))
    rotations = affected_rotations(glove)
    bent = replace(settings, method="lmc_gpr")  # a straight line would leave the twin its own mild curve
    twin = held_out_errors(PreparedTakes.of(glove.clean_takes, glove.layout), rotations, (), bent)
    told = {"twin_deg": _rmse(twin, rotations), **glove.told()}
    try:
        addition = add_effect(
            model,
            takes,
            glove.truth,
            rotations=rotations,
            constants=repair_constants(glove, rotations),
            settings=settings,
            limits=limits,
        )
    except BadInput:
        before = held_out_errors(PreparedTakes.of(takes, glove.layout), rotations, (), settings)
        told |= {"added": False, "before_deg": _rmse(before, rotations)}
    else:
        model, before, after = addition.model, addition.before, addition.after
        left_out = [name for name in rotations if name not in before.square]
        if left_out:  # where the effect raised the error: there it stays as it was
            same = held_out_errors(PreparedTakes.of(takes, glove.layout), left_out, (), settings)
            before, after = before.with_those_of(same), after.with_those_of(same)
        told |= {
            "added": addition.added,
            "before_deg": _rmse(before, rotations),
            "after_deg": _rmse(after, rotations),
        }
    if glove.truth in COVERAGE:
        told["covered"] = _covered(glove, model, rotations)
    elif is_judged_by_ceiling(glove) or error_after(told) > CLOSE_TO_TWIN * told["twin_deg"]:
        told["ceiling"] = ceiling_of(model, takes, glove)
    return told


def is_judged_by_ceiling(glove: BlindGlove) -> bool:
    return glove.truth in REMEMBERING and glove.lead_s == 0


def error_after(answer: dict[str, Any]) -> float:
    """Degrees; an effect that was undone, or could not be added, leaves the error as it was."""
    return answer["after_deg"] if answer["added"] else answer["before_deg"]


def affected_rotations(glove: BlindGlove) -> tuple[str, ...]:
    """Joints whose own sensor has the cause."""
    channels = {name for item in glove.session.causes[: len(glove.causes)] for name in item.channels}
    return tuple(name for name in glove.layout.rotations if name in channels)


def _rmse(errors: HeldOutErrors, rotations: tuple[str, ...]) -> float:
    square = sum(errors.square[name] for name in rotations)
    return round(float(np.sqrt(square / max(sum(errors.count[name] for name in rotations), 1))), 3)


def _covered(glove: BlindGlove, model: CalibrationModel, rotations: tuple[str, ...]) -> float:
    """Share of a new take's measurements inside the 95 % interval."""
    take = glove.also("natural", 40.0, 0)
    angles = GlovePredictor(model).predict_take(take.time_s, take.readings, take.context, take.wearing)
    reference = take.reference_at_frames(model.rotation_names)
    columns = [model.rotation_names.index(name) for name in rotations]
    error = np.abs(angles.mean - reference)[:, columns]
    known = np.isfinite(error)
    return round(float(np.mean((error <= WITHIN_SD * angles.sd[:, columns])[known])), 4)
