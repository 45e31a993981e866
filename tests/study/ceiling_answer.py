"""The black-box ceiling: of a model that lacks what is hidden, and beside what ``improve`` saves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from blind_glove import BlindGlove
from calibration_settings import training_settings

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.training import train
from glovecal_models.ceiling.black_box_ceiling import black_box_ceiling
from glovecal_models.improvement.improve import improve
from glovecal_models.improvement.limits import IMPROVEMENT_LIMITS, ImprovementLimits
from glovecal_models.takes.take import Take


def ceiling_answer(glove: BlindGlove, limits: ImprovementLimits = IMPROVEMENT_LIMITS) -> dict[str, Any]:
    """Of the base, with nothing repaired. The ceiling has limits of its own, those as usual."""
    del limits
    takes = glove.takes
    model = train(takes, glove.layout, "study", training_settings(glove, folds=0))
    return {"ceiling": ceiling_of(model, takes, glove), **glove.told()}


def recorded_answer(glove: BlindGlove, limits: ImprovementLimits = IMPROVEMENT_LIMITS) -> dict[str, Any]:
    """The ceiling of the base, and the error over all joints before and after what ``improve`` adds."""
    takes = glove.takes
    found = improve(takes, glove.layout, "study", training_settings(glove), limits=limits)
    return {
        "added": [step.added.effect for step in found.steps if step.added is not None],
        "rmse_deg": [round(step.rmse_deg, 3) for step in found.steps],
        "ceiling": ceiling_of(found.steps[0].model, takes, glove),
    }


def ceiling_of(model: CalibrationModel, takes: Sequence[Take], glove: BlindGlove) -> dict[str, Any]:
    """Verdict, and the share of the RMSE that the box takes off; 0 where the takes cannot tell."""
    found = black_box_ceiling(model, takes, training_settings(glove))
    return {"verdict": found.verdict, "share": round(found.overall.share, 4) if found.overall else 0.0}
