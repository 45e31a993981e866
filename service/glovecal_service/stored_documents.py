"""Documents of jobs under today's names: what an earlier service stored is translated here, and only here."""

from __future__ import annotations

from typing import Any

NEW_NAMES = {
    "over_all": "overall",
    "not_judgeable": "not_identifiable",
    "something_left": "unexplained_residual",
    "is_left": "is_significant",
    "goes_with": "associations",
    "rmse_decoy_deg": "rmse_control_deg",
    "decoy_rmse_deg": "control_rmse_deg",
    "decoy_saved_deg": "control_saved_deg",
    "decoy_saved_share": "control_saved_share",
    "probability": "p_value",
}


def current(document: Any) -> Any:
    """A copy with today's keys at every depth. A document that has both keeps today's value."""
    if isinstance(document, dict):
        named = {NEW_NAMES.get(key, key): current(value) for key, value in document.items()}
        return named | {key: current(value) for key, value in document.items() if key in named}
    if isinstance(document, list | tuple):
        return [current(item) for item in document]
    return document
