"""What became of an effect that was added."""

from __future__ import annotations

from typing import Any

from pydantic import Field

from glovecal_models.improvement.add_interval import claim_evidence
from glovecal_models.improvement.addition import Addition, ClaimCheck
from glovecal_models.improvement.text import addition_sentence
from glovecal_service.views.form_curves import LaneCurvesView, curve_views
from glovecal_service.views.view import View


class ClaimView(View):
    """Claimed standard deviations on held-out takes; expected: coverage 0.68 and 0.95."""

    nlpd_before: float | None
    coverage_before: float | None
    coverage_95_before: float | None
    nlpd_after: float | None
    coverage_after: float | None
    coverage_95_after: float | None

    @classmethod
    def of(cls, claim: ClaimCheck | None) -> ClaimView | None:
        return None if claim is None else cls(**claim_evidence(claim))


class AdditionView(View):
    effect: str
    where: list[str] = Field(description="Rotations.")
    added: bool
    sentence: str
    before: dict[str, float | None] = Field(description="Held-out error of each rotation, degrees.")
    after: dict[str, float | None] = Field(description="With it.")
    parameters: dict[str, dict[str, Any]] = Field(
        description="Learned numbers of each rotation, units in their names."
    )
    curves: dict[str, LaneCurvesView] = Field(
        {}, description="For each rotation what a learned form adds over its inputs."
    )
    claim: ClaimView | None = Field(None, description="Of an effect that widens the claimed interval.")

    @classmethod
    def of(cls, addition: Addition) -> AdditionView:
        return cls(
            effect=addition.effect,
            where=list(addition.rotations),
            added=addition.added,
            sentence=addition_sentence(addition),
            before={name: addition.before.rmse_deg(name) for name in addition.rotations},
            after={name: addition.after.rmse_deg(name) for name in addition.rotations},
            parameters=dict(addition.parameters),
            curves=curve_views(addition.curves),
            claim=ClaimView.of(addition.claim),
        )


class AdditionResult(AdditionView):
    """Of an ``add_effect`` job."""

    model: str | None = Field(description="The child; null when the effect was undone.")
    parent: str
    active: bool
