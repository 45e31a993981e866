"""Keys and values that were renamed: results that jobs stored before still have the old ones."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

RENAMED = {
    "not_judgeable": "not_identifiable",
    "something_left": "unexplained_residual",
    "is_left": "is_significant",
    "goes_with": "associations",
    "rmse_decoy_deg": "rmse_control_deg",
    "decoy_saved_deg": "control_saved_deg",
    "decoy_saved_share": "control_saved_share",
    "decoy_rmse_deg": "control_rmse_deg",
    "decoy": "control",
    "probability": "p_value",
    "over_all": "overall",
}
"""Old to new."""
RENAMED_VERDICTS = {"not_judgeable": "not_identifiable"}


def with_current_keys(document: Any, known: Collection[str]) -> Any:
    """``document`` with each old key whose new name is ``known`` renamed, unless that is there too."""
    if not isinstance(document, Mapping):
        return document
    return {_current(key, document, known): value for key, value in document.items()}


def _current(key: str, document: Mapping[str, Any], known: Collection[str]) -> str:
    new = RENAMED.get(key)
    return key if new is None or key in known or new not in known or new in document else new


def current_evidence(evidence: Mapping[str, Any]) -> dict[str, Any]:
    """What an effect saved when a model got it; stored models keep the old keys."""
    return with_current_keys(evidence, ("rmse_control_deg",))


def current_verdict(verdict: Any) -> Any:
    """A verdict by its present name."""
    return RENAMED_VERDICTS.get(verdict, verdict) if isinstance(verdict, str) else verdict


def current_residual(residual: Any) -> Any:
    """An improvement's unexplained residual: once it was only whether there is one."""
    return {"is_significant": residual, "sentence": ""} if isinstance(residual, bool) else residual


def current(document: Any) -> Any:
    """A copy with today's keys at every depth. A document that has both keeps today's value."""
    if isinstance(document, dict):
        named = {RENAMED.get(key, key): current(value) for key, value in document.items()}
        return named | {key: current(value) for key, value in document.items() if key in named}
    if isinstance(document, list | tuple):
        return [current(item) for item in document]
    return document
