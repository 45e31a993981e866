"""What ``improve`` does with one glove by itself: effects added, verdicts, errors and the alarm."""

from __future__ import annotations

from typing import Any

from blind_glove import BlindGlove
from diagnosis_answer import diagnosis_answer
from repair_answer import training_settings

from glovecal_models.calibration.held_out_check import held_out_errors
from glovecal_models.calibration.prepared_takes import PreparedTakes
from glovecal_models.improvement.improve import improve
from glovecal_models.improvement.limits import IMPROVEMENT_LIMITS, ImprovementLimits
from glovecal_models.improvement.text import improvement_sentences


def walk_answer(glove: BlindGlove, limits: ImprovementLimits = IMPROVEMENT_LIMITS) -> dict[str, Any]:
    """The diagnosis of the untouched takes, and the whole walk."""
    return diagnosis_answer(glove, limits) | {"walk": walk(glove, limits)}


def pair_answer(glove: BlindGlove, limits: ImprovementLimits = IMPROVEMENT_LIMITS) -> dict[str, Any]:
    """The same, and the clean twin's error beside the walk's last one, over all joints."""
    settings = training_settings(glove)
    prepared = PreparedTakes.of(glove.clean_takes, glove.layout)
    twin = held_out_errors(prepared, glove.layout.rotations, (), settings)
    return walk_answer(glove, limits) | {"twin_deg": round(twin.overall_deg, 4)}


def walk(glove: BlindGlove, limits: ImprovementLimits = IMPROVEMENT_LIMITS) -> dict[str, Any]:
    """What is marked of an improvement."""
    found = improve(glove.takes, glove.layout, "study", training_settings(glove), limits=limits)
    added = [step.added for step in found.steps if step.added is not None]
    return {
        "added": [item.effect for item in added],
        "verdicts": [item.verdict for item in added],
        "confidence_sets": [list(item.confidence_set) for item in added],
        "rmse_deg": [round(step.rmse_deg, 4) for step in found.steps],
        "undone": [item.effect for item in found.undone],
        "stopped": found.stopped,
        "unexplained_residual": bool(found.diagnosis and found.diagnosis.residual.is_significant),
        "sentences": improvement_sentences(found),
    }
