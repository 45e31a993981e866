"""Long work as REST gives it."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from pydantic import Field

from glovecal_models.presentation.document import counted
from glovecal_service.plain import Row
from glovecal_service.store.records import JobState


class JobFacts(Row):
    id: str
    kind: str
    subject: str | None
    payload: dict[str, Any]
    state: JobState
    attempt: int
    cancel_requested: bool
    fraction: float = Field(description="Done so far, 0 to 1.")
    sentence: str
    detail: dict[str, Any]
    error: str | None
    traceback: str | None = Field(
        description="Python's, of a job that failed by an error in Glovecal itself; at most 8,000 characters."
    )
    created_at: datetime
    started_at: datetime | None
    finished_at: datetime | None
    updated_at: datetime

    @property
    def about(self) -> str:
        """The model or the takes that it works on."""
        model, takes = self.payload.get("model"), self.payload.get("takes")
        on = [f"model {str(model)[:12]}"] if model else []
        if isinstance(takes, list):
            on.append(counted(len(takes), "take"))
        effect = self.payload.get("effect")
        return ", ".join([*([str(effect)] if effect else []), *on])

    @property
    def took_s(self) -> float | None:
        """From the first start to the end; None before it."""
        if self.started_at is None or self.finished_at is None:
            return None
        return (self.finished_at - self.started_at).total_seconds()


class JobRow(JobFacts):
    """In a list."""

    has_result: bool = Field(description="Whether it found or made something: `GET /v1/jobs/{id}`.")
    model: str | None = Field(description="That its result names.")


class Job(JobFacts):
    result: dict[str, Any] | None = Field(description="Of a job of its kind: see where it is begun.")
