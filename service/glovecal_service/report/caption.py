"""A model as a page names it: subject, method, version and date; the hash stands in the details."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from typing import TYPE_CHECKING

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.errors import GlovecalError

if TYPE_CHECKING:
    from glovecal_service.store.store import Store


@dataclass(frozen=True)
class Caption:
    """What is known of a model without loading it; ``version`` counts it and the models it was made from."""

    id: str
    subject: str = ""
    method: str = ""
    version: int | None = None
    made: date | None = None
    hand: str | None = None

    @property
    def title(self) -> str:
        """ "anna, version 2 of 22 November 2026"."""
        if not self.subject:
            return f"model {self.id[:12]}"
        version = "" if self.version is None else f", version {self.version}"
        made = "" if self.made is None else f"{' of' if version else ','} {long_date(self.made)}"
        return f"{self.subject}{version}{made}"


@dataclass(frozen=True)
class ReportedModel:
    """A model with what a comparison has to know of it."""

    id: str
    model: CalibrationModel
    trained_on: Sequence[str] = ()
    """Ids of those takes of the report that it was trained on."""
    caption: Caption | None = None

    @property
    def name(self) -> str:
        """ "lmc_gpr 1f3a5c"."""
        return f"{self.model.method} {self.id[:6]}"

    @property
    def title(self) -> str:
        return (self.caption or Caption(self.id, self.model.subject, self.model.method)).title


def caption_of(store: Store, id: str) -> Caption:
    """Of a stored model; of one that can no longer be read only the id."""
    try:
        line = store.models.lineage(id)
    except GlovecalError:
        return Caption(id)
    return Caption(
        line[0].id, line[0].subject, line[0].method, len(line), line[0].created_at.date(), line[0].hand
    )


def long_date(day: date) -> str:
    """ "22 November 2026", whatever the locale."""
    months = (
        *("January", "February", "March", "April", "May", "June", "July", "August", "September"),
        *("October", "November", "December"),
    )
    return f"{day.day} {months[day.month - 1]} {day.year}"
