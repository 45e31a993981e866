"""What ``improve`` does with one glove by itself: effects added, verdicts, errors and the alarm."""

from __future__ import annotations

from typing import Any

from blind_glove import BlindGlove
from calibration_settings import training_settings
from diagnosis_answer import diagnosis_answer, names_of

from glovecal_models.calibration.leave_out import held_out_errors
from glovecal_models.calibration.prepared_takes import PreparedTakes
from glovecal_models.improvement.improve import improve
from glovecal_models.improvement.limits import IMPROVEMENT_LIMITS, ImprovementLimits


def walk_answer(glove: BlindGlove, limits: ImprovementLimits = IMPROVEMENT_LIMITS) -> dict[str, Any]:
    """The diagnosis of the untouched takes, and the whole walk."""
    return diagnosis_answer(glove, limits) | {"walk": walk(glove, limits)}


def pair_answer(glove: BlindGlove, limits: ImprovementLimits = IMPROVEMENT_LIMITS) -> dict[str, Any]:
    """The walk alone, and the clean twin's error beside the walk's last one, over all joints."""
    settings = training_settings(glove)
    prepared = PreparedTakes.of(glove.clean_takes, glove.layout)
    twin = held_out_errors(prepared, glove.layout.rotations, (), settings)
    return only_walk_answer(glove, limits) | {"twin_deg": round(twin.overall_deg, 3)}


def only_walk_answer(glove: BlindGlove, limits: ImprovementLimits = IMPROVEMENT_LIMITS) -> dict[str, Any]:
    """The whole walk, and the names that are true."""
    return {"right": names_of(glove), "walk": walk(glove, limits)}


def walk(glove: BlindGlove, limits: ImprovementLimits = IMPROVEMENT_LIMITS) -> dict[str, Any]:
    """What is marked of an improvement."""
    found = improve(glove.takes, glove.layout, "study", training_settings(glove), limits=limits)
    added = [step.added for step in found.steps if step.added is not None]
    return {
        "added": [item.effect for item in added],
        "verdicts": [item.verdict for item in added],
        "confidence_sets": [list(item.confidence_set) for item in added],
        "rmse_deg": [round(step.rmse_deg, 3) for step in found.steps],
        "unexplained_residual": bool(found.diagnosis and found.diagnosis.residual.is_significant),
    }
