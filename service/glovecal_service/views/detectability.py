"""What takes could have shown: sizes at which effects are named in trials, and effects that look alike."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import Field

from glovecal_models.diagnosis.detectability.confusability import Confusability
from glovecal_models.diagnosis.detectability.detection import Control, Detectability, SizeTried
from glovecal_models.diagnosis.detectability.text import (
    FOUND,
    confusability_sentences,
    control_sentence,
    detectability_sentence,
)
from glovecal_service.views.diagnosis import TakeNamed
from glovecal_service.views.next_take import NextTakeView
from glovecal_service.views.view import View


class SizeTriedView(View):
    size_deg: float = Field(description="RMS of what is put in and no static map explains.")
    trials: int = Field(description="0: these takes cannot hold so much of the effect.")
    named: int = Field(description="It alone is named.")
    ambiguous: int = Field(description="It is named together with others.")
    mistaken: int = Field(description="Only others are named.")
    not_found: int
    mistaken_for: dict[str, int] = Field({}, description="Effects named instead, and how often.")

    @classmethod
    def of(cls, item: SizeTried) -> SizeTriedView:
        return cls(
            size_deg=item.size_deg,
            trials=len(item.trials),
            named=item.count("named"),
            ambiguous=item.count("ambiguous"),
            mistaken=item.count("mistaken"),
            not_found=item.count("not found"),
            mistaken_for=dict(item.mistaken_for),
        )


class EffectDetectabilityView(View):
    effect: str
    rotations: list[str] = Field(description="On which it is put in, all at once.")
    why_not: str | None = Field(None, description="Why these takes cannot show it at any size.")
    sizes: list[SizeTriedView] = Field([])
    named_50_deg: float | None = Field(
        None, description="Size at which half of the trials name it alone, interpolated; null: none tried."
    )
    named_80_deg: float | None = Field(None, description="The same of 80 % of the trials.")
    found_50_deg: float | None = Field(None, description="Named alone or together with others, half of them.")
    sentence: str

    @classmethod
    def of(cls, found: Detectability) -> EffectDetectabilityView:
        return cls(
            effect=found.effect,
            rotations=list(found.rotations),
            why_not=found.why_not,
            sizes=[SizeTriedView.of(item) for item in found.sizes],
            named_50_deg=found.size_deg(0.5, "named"),
            named_80_deg=found.size_deg(0.8, "named"),
            found_50_deg=found.size_deg(0.5, *FOUND),
            sentence=detectability_sentence(found),
        )


class DetectabilityControlView(View):
    """Trials with nothing put in."""

    trials: int
    named: dict[str, int] = Field({}, description="What is named nevertheless, and how often.")
    sentence: str

    @classmethod
    def of(cls, control: Control) -> DetectabilityControlView:
        return cls(
            trials=len(control.trials), named=dict(control.named), sentence=control_sentence(control)
        )  # fmt: skip


class PairOfEffectsView(View):
    effects: list[str] = Field(description="The second imitates the first.")
    rotation: str = Field(description="Where they are most alike.")
    correlation: float | None = Field(description="Of what they add, the static map projected out; 0 to 1.")
    is_confused: bool = Field(description="Whether the correlation is above the limit.")
    next_take: NextTakeView | None = None


class ConfusabilityView(View):
    effects: list[str]
    pairs: list[PairOfEffectsView] = Field(description="The most alike first.")
    condition: dict[str, float | None] = Field(
        {}, description="Condition number of all effects together, by rotation; null: infinite."
    )
    condition_of_others: dict[str, float | None] = Field(
        {}, description="The same, one of each confused pair left out."
    )
    not_applicable: dict[str, str] = Field({}, description="Effects these takes cannot show, and why.")
    sentences: list[str] = Field([])

    @classmethod
    def of(cls, found: Confusability) -> ConfusabilityView:
        return cls(
            effects=list(found.effects),
            pairs=[
                PairOfEffectsView(
                    effects=list(pair.effects),
                    rotation=pair.rotation,
                    correlation=pair.correlation,
                    is_confused=pair.is_confused,
                    next_take=NextTakeView.of(pair.next_take),
                )
                for pair in found.pairs
            ],
            condition=dict(found.condition),
            condition_of_others=dict(found.condition_of_others),
            not_applicable=dict(found.not_applicable),
            sentences=confusability_sentences(found),
        )


class DetectabilityResult(View):
    """Of a ``detectability`` job."""

    subject: str
    model: str | None = Field(description="Null: the takes were looked at without a model.")
    takes: list[TakeNamed] = Field([])
    simulated: bool = Field(False, description="Whether any of the takes is of a simulated glove.")
    trials: int = Field(description="For each size.")
    residual_deg: dict[str, float | None] = Field(
        {}, description="RMS of noise and nuisance as measured, by rotation: what effects have to exceed."
    )
    effects: list[EffectDetectabilityView]
    control: DetectabilityControlView
    confusability: ConfusabilityView
    sentences: list[str] = Field(description="What to know, the most important first.")


def size_text(item: Mapping[str, Any], size_deg: float | None) -> str:
    """A size of an effect's document: the smallest tried may be smaller, one not reached is larger."""
    tried = [size["size_deg"] for size in item["sizes"] if size["trials"]]
    if size_deg is None:
        return f"> {tried[-1]:g}" if tried else "-"
    return f"<= {size_deg:g}" if size_deg == tried[0] else f"{size_deg:.2g}"
