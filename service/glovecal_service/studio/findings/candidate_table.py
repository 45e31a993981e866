"""Held-out errors with each effect beside those with its control, as a table with bars."""

from __future__ import annotations

from collections.abc import Sequence

from nicegui import ui

from glovecal_models.diagnosis.trial.answer import Candidate
from glovecal_service.studio.amounts import degrees
from glovecal_service.studio.table import cell, row_head, table

HEADS = ("Effect", "Error reduced by", "Error of the sensors", "With its control", "Significant on")


def candidate_table(candidates: Sequence[Candidate]) -> None:
    """``candidates``: of a diagnosis, the best first."""
    largest = max([0.01, *(item.saved_deg for item in candidates)])
    with table("Smoothed error of the sensors with each effect, on held-out takes", HEADS, "candidate-table"):
        for item in candidates:
            _row(item, largest)


def bar_key() -> None:
    """What the bars are."""
    with ui.element("div").classes("bar-key"):
        for kind, text in (
            ("saved-by-effect", "effect, significant"),
            ("saved-by-chance", "effect, not significant"),
            ("saved-by-control", "its control: as free, and cannot be right"),
        ):
            with ui.element("span"):
                ui.element("i").classes(f"saved-bar {kind}")
                ui.label(text)


def _row(item: Candidate, largest: float) -> None:
    with ui.element("tr"):
        row_head(item.effect)
        with ui.element("td").classes("saved-cell"):
            _bar(item.saved_deg, largest, "saved-by-effect" if item.passes else "saved-by-chance")
            _bar(item.control_saved_deg, largest, "saved-by-control")
        cell(f"{degrees(item.rmse_before_deg)} → {degrees(item.rmse_after_deg)}")
        cell(degrees(item.rmse_control_deg))
        cell(", ".join(item.where) or "no rotation").classes("candidate-where")


def _bar(saved: float, largest: float, kind: str) -> None:
    share = 100.0 * min(1.0, max(0.0, saved) / largest)
    ui.element("div").classes(f"saved-bar {kind}").style(f"--share: {share:.1f}%")
