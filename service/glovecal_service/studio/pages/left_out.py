"""What is left out of a dropped file, once for each reason."""

from __future__ import annotations

from collections.abc import Mapping

from nicegui import ui

from glovecal_models.presentation.document import first_of

MOST_NAMED = 12


def tell_left_out(reasons: Mapping[str, str]) -> None:
    """``reasons`` by the name of a sensor or rotation."""
    for reason in dict.fromkeys(reasons.values()):
        names = [name for name, why in reasons.items() if why == reason]
        ui.label(f"Left out: {first_of(names, MOST_NAMED)} ({reason}).").classes("take-warning")
