"""The black-box ceiling, as an answer shows it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import Field

from glovecal_models.ceiling.ceiling import Ceiling, Gain
from glovecal_models.ceiling.text import ceiling_sentence
from glovecal_service.views.view import View


class GainView(View):
    rmse_deg: float | None = Field(description="Error of the model on left-out quarters of its takes.")
    ceiling_deg: float | None = Field(description="What a black box on everything recorded leaves of it.")
    lowest_deg: float | None = Field(description="With the upper 95 % bound of what the box gains.")
    low_share: float | None = Field(
        description="95 % interval of the gain by whole takes, share of the RMSE."
    )
    high_share: float | None
    p_value: float | None = Field(description="By flipping the sign of whole takes.")

    @classmethod
    def of(cls, gain: Gain) -> GainView:
        return cls(
            rmse_deg=gain.rmse_deg,
            ceiling_deg=gain.ceiling_deg,
            lowest_deg=gain.lowest_deg,
            low_share=gain.low_share,
            high_share=gain.high_share,
            p_value=gain.p_value,
        )


class CeilingView(View):
    verdict: str = Field(description="gain, none or undecided.")
    sentence: str
    overall: GainView | None = Field(description="Null: these takes cannot tell.")
    rotations: dict[str, GainView] = Field({})
    groups: dict[str, float | None] = Field(
        {}, description="Where there is a gain: which recorded columns it comes from, RMS degrees."
    )
    unrecorded: list[str] = Field([], description="Context columns that some effect reads and no take has.")
    takes: int = Field(0, description="Whole takes left out one quarter at a time.")

    @classmethod
    def of(cls, found: Ceiling | None) -> CeilingView | None:
        if found is None:
            return None
        return cls(
            verdict=found.verdict,
            sentence=ceiling_sentence(found),
            overall=None if found.overall is None else GainView.of(found.overall),
            rotations={name: GainView.of(gain) for name, gain in found.rotations.items()},
            groups=dict(found.groups),
            unrecorded=list(found.unrecorded),
            takes=found.takes,
        )


class CeilingResult(CeilingView):
    """Of a ``ceiling`` job."""

    model: str


def ceiling_view(document: Mapping[str, Any] | None) -> CeilingView | None:
    """Of what was stored."""
    return None if document is None else CeilingView.model_validate(dict(document))
