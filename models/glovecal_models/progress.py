"""How long work says how far it is, and how it is asked to stop: the same two callables everywhere."""

from __future__ import annotations

from collections.abc import Callable

from glovecal_models.errors import Cancelled

Report = Callable[[str, float], None]
"""Takes a sentence and the fraction done, 0 to 1."""
Cancel = Callable[[], bool]
"""Says True once the work is to stop."""


def stop_if(cancelled: Cancel | None, what: str) -> None:
    """Raise Cancelled, naming ``what``, when ``cancelled`` says so."""
    if cancelled and cancelled():
        raise Cancelled(f"{what} was cancelled")


def part(report: Report | None, low: float, high: float, what: str = "") -> Report | None:
    """For work that is the piece from ``low`` to ``high`` of a whole; ``what`` begins its sentences."""
    if report is None:
        return None
    before = f"{what}: " if what else ""
    return lambda sentence, fraction: report(f"{before}{sentence}", low + (high - low) * fraction)
