"""Whether anything is left to gain from what was recorded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace

from glovecal_models.presentation.document import (
    AboutTakes,
    Answer,
    Column,
    Fact,
    Presentation,
    Section,
    Table,
    answer,
)

LEGEND = (
    "Error on left-out quarters of the takes, in degrees. ceiling: what a black box on everything recorded "
    "leaves of it; at least: with the upper 95 % bound of its gain; p: by flipping the sign of whole takes; "
    "offline: of recordings, estimated with both directions of time. The box is never served."
)


@answer
class PossibleGain:
    """The error of one rotation, or of all, and what a black box takes off it."""

    rmse_deg: float | None
    """Error of the model on left-out quarters of its takes."""
    ceiling_deg: float | None
    """What a black box on everything recorded leaves of it."""
    lowest_deg: float | None
    """With the upper 95 % bound of what the box gains."""
    low_share: float | None
    """95 % interval of the gain by whole takes, share of the RMSE."""
    high_share: float | None
    p_value: float | None
    """By flipping the sign of whole takes."""
    offline_deg: float | None = None
    """Error of the model on the same quarters, estimated with both directions of time: the limit of
    recordings. Null: an answer of before this was estimated."""


@answer
class LeftToGain(Answer):
    """The black-box ceiling of a model."""

    verdict: str
    """gain, none or undecided."""
    sentence: str
    overall: PossibleGain | None
    """Null: these takes cannot tell."""
    rotations: Mapping[str, PossibleGain] = field(default_factory=dict)
    groups: Mapping[str, float | None] = field(default_factory=dict)
    """Where there is a gain: which recorded columns it comes from, RMS degrees."""
    unrecorded: Sequence[str] = ()
    """Context columns that some effect reads and no take has."""
    left_out: int = 0
    """Whole takes, left out one quarter at a time."""

    def presentation(self) -> Presentation:
        columns = [
            Column("rotation"), Column("rmse_deg", "error"), Column("ceiling_deg", "ceiling"),
            Column("lowest_deg", "at least"), Column("p_value", "p", 3), Column("offline_deg", "offline"),
        ]  # fmt: skip
        every = {} if self.overall is None else {"all": self.overall, **self.rotations}
        rows = [
            [name, gain.rmse_deg, gain.ceiling_deg, gain.lowest_deg, gain.p_value, gain.offline_deg]
            for name, gain in every.items()
        ]
        errors = [Table(columns, rows, legend=LEGEND)] if rows else []
        return Presentation(
            "What is left to gain", [Fact("Verdict", self.sentence)], sections=[Section("Errors", errors)]
        )


@answer
class CeilingOfModel(LeftToGain, AboutTakes):
    """The same, of a model on takes."""

    def presentation(self) -> Presentation:
        return replace(super().presentation(), title=f"What {self.about} leave to gain")
