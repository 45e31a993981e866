"""All questions by their kind, which is the name in a job's row."""

from __future__ import annotations

from collections.abc import Mapping

from glovecal_service.questions import comparison, detectability, examination, explanation, holds, quick_check
from glovecal_service.questions.add_effect import ADD_EFFECT
from glovecal_service.questions.at_once import AtOnce
from glovecal_service.questions.calibration_report import CALIBRATION_REPORT
from glovecal_service.questions.ceiling import CEILING
from glovecal_service.questions.diagnose import DIAGNOSE
from glovecal_service.questions.improve import IMPROVE
from glovecal_service.questions.making import Making
from glovecal_service.questions.question import Question
from glovecal_service.questions.remove_effect import REMOVE_EFFECT
from glovecal_service.questions.train import TRAIN

QUESTIONS: Mapping[str, Question] = {
    item.kind: item
    for item in (
        DIAGNOSE,
        CEILING,
        detectability.QUESTION,
        comparison.COMPARE,
        comparison.WHERE,
        CALIBRATION_REPORT,
    )
}
AT_ONCE: Mapping[str, AtOnce] = {
    item.kind: item
    for item in (examination.QUESTION, explanation.QUESTION, holds.QUESTION, quick_check.QUESTION)
}
MAKINGS: Mapping[str, Making] = {item.kind: item for item in (TRAIN, ADD_EFFECT, REMOVE_EFFECT, IMPROVE)}
ANSWERED: Mapping[str, Question | Making] = {
    **{kind: item for kind, item in QUESTIONS.items() if item.work is not None},
    **MAKINGS,
}
"""Those that jobs answer."""
