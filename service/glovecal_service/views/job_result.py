"""Results of jobs, read back from what was stored."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError

from glovecal_service.views.addition import AdditionResult
from glovecal_service.views.ceiling import CeilingResult
from glovecal_service.views.detectability import DetectabilityResult
from glovecal_service.views.diagnosis import DiagnosisResult
from glovecal_service.views.improvement import ImprovementView
from glovecal_service.views.view import View

VIEW_OF: Mapping[str, type[View]] = {
    "detectability": DetectabilityResult,
    "diagnose": DiagnosisResult,
    "ceiling": CeilingResult,
    "improve": ImprovementView,
    "add_effect": AdditionResult,
}
"""By the kind of job."""


def current_result(kind: str, result: Mapping[str, Any] | None) -> dict[str, Any] | None:
    """As its view shows it; a result that is not what its kind promises is given as it was stored."""
    if result is None:
        return None
    view = VIEW_OF.get(kind)
    try:
        return dict(result) if view is None else view.model_validate(result).document()
    except ValidationError:
        return dict(result)
