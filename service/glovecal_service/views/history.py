"""The calibrations and quick checks of a subject in order of time, and whether a full calibration is due."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import Any, Literal

from pydantic import BaseModel, Field

from glovecal_models.hand.handedness import Handedness, is_of_hand
from glovecal_models.quick_check.text import DUE
from glovecal_service.plain import plain
from glovecal_service.store.records import ModelRecord


class HistoryRowView(BaseModel):
    made_at: datetime
    model: str
    layout: str
    hand: Handedness | None = Field(description="Whose glove; null: its takes do not say.")
    kind: Literal["calibration", "quick check"]
    wearing: str | None = Field(description="Of a quick check.")
    as_found_deg: float | None = Field(
        description="Of a quick check: RMS error of its poses with the model before, in that wearing."
    )
    as_left_deg: float | None = Field(description="After the check, each pose predicted from the others.")
    rmse_unseen_wearing_deg: float | None = Field(description="Of the calibration, in a wearing not seen.")
    held_out_rmse_deg: float | None = Field(description="Of the calibration, in wearings seen.")


class HistoryView(BaseModel):
    subject: str
    rows: list[HistoryRowView] = Field(description="Oldest first.")
    is_full_calibration_due: bool = Field(
        description="By the last quick check after the last calibration, of either hand."
    )
    sentences: list[str]


def history_view(subject: str, records: Sequence[ModelRecord]) -> HistoryView:
    """``records``: the subject's models, oldest first."""
    rows = [_row(record) for record in records]
    hands: set[Handedness | None] = {record.hand for record in records if record.hand} or {None}
    newest = [next((each for each in records[::-1] if is_of_hand(each.hand, hand)), None) for hand in hands]
    is_due = any(
        each.facts.get("quick_check", {}).get("is_full_calibration_due")
        for each in newest
        if each is not None
    )
    checks = [row for row in rows if row["as_found_deg"] is not None]
    sentences = []
    if checks:
        found = ", ".join(f"{row['as_found_deg']:.1f}" for row in checks)
        sentences.append(f"As found, in the order of the quick checks: {found} degrees.")
    if is_due:
        sentences.append(DUE)
    return HistoryView.model_validate(
        {"subject": subject, "rows": rows, "is_full_calibration_due": is_due, "sentences": sentences}
    )


def _row(record: ModelRecord) -> dict[str, Any]:
    check = record.facts.get("quick_check")
    names = ("rmse_unseen_wearing_deg", "held_out_rmse_deg")
    of_check = {name: (check or {}).get(name) for name in ("wearing", "as_found_deg", "as_left_deg")}
    return plain(
        {
            "made_at": record.created_at,
            "model": record.id,
            "layout": record.layout,
            "hand": record.hand,
            "kind": "calibration" if check is None else "quick check",
            **of_check,
            **{name: record.facts.get(name) if check is None else None for name in names},
        }
    )
