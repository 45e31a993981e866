"""The improvement loop: every step, what was undone, and why it stopped."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pydantic import Field

from glovecal_models.diagnosis.diagnosis import Verdict
from glovecal_models.improvement.improvement import AddedInStep, Improvement, Step
from glovecal_models.improvement.text import improvement_sentences, is_noise
from glovecal_service.views.addition import AdditionView, ClaimView
from glovecal_service.views.ceiling import CeilingView
from glovecal_service.views.diagnosis import UnexplainedResidualView
from glovecal_service.views.form_curves import LaneCurvesView, curve_views
from glovecal_service.views.hold_drift import HoldDriftView
from glovecal_service.views.next_take import NextTakeView
from glovecal_service.views.noise_floor import NoiseFloorView
from glovecal_service.views.view import View


class AddedInStepView(View):
    effect: str
    where: list[str]
    verdict: Verdict
    confidence_set: list[str] = Field(description="It, and all that the takes could not tell from it.")
    parameters: dict[str, Any] = Field(description="Learned numbers, units in their names.")
    curves: dict[str, LaneCurvesView] = Field(
        {}, description="For each rotation what a learned form adds over its inputs."
    )
    associated_with: str | None = Field(
        None, description="The column that the residual went along with, where no cause is claimed."
    )
    claim: ClaimView | None = None
    next_take: NextTakeView | None = None

    @classmethod
    def of(cls, added: AddedInStep | None) -> AddedInStepView | None:
        if added is None:
            return None
        return cls(
            effect=added.effect,
            where=list(added.where),
            verdict=added.verdict,
            confidence_set=list(added.confidence_set),
            parameters=dict(added.parameters),
            curves=curve_views(added.curves),
            associated_with=added.associated_with,
            claim=ClaimView.of(added.claim),
            next_take=NextTakeView.of(added.next_take),
        )


class StepView(View):
    model: str | None = Field(description="Its id.")
    added: AddedInStepView | None = Field(description="Null: the base alone.")
    rmse_deg: float | None = Field(description="Over all rotations.")
    per_rotation: dict[str, float | None]
    control_rmse_deg: float | None = Field(None, description="With the control of the effect instead.")
    rmse_unseen_wearing_deg: float | None = Field(
        None, description="In a wearing that training did not see; null: one wearing only."
    )

    @classmethod
    def of(cls, step: Step, model: str | None) -> StepView:
        return cls(
            model=model,
            added=AddedInStepView.of(step.added),
            rmse_deg=step.rmse_deg,
            per_rotation=dict(step.per_rotation),
            control_rmse_deg=step.control_rmse_deg,
            rmse_unseen_wearing_deg=step.rmse_unseen_wearing_deg,
        )


class ImprovementView(View):
    steps: list[StepView]
    baselines: dict[str, float | None] = Field({}, description="Errors of simpler calibrations, degrees.")
    noise_floor_deg: dict[str, float | None]
    noise_floor_interval_deg: dict[str, list[float | None]] = Field({})
    noise_floors: dict[str, NoiseFloorView] = Field(
        {}, description="The same with how it was found and how far it can be trusted."
    )
    stopped: str = Field(description="noise_floor, nothing_named, ambiguous or not_better.")
    undone: list[AdditionView]
    hold_drift: HoldDriftView | None = None
    unexplained_residual: UnexplainedResidualView | None = Field(None, description="Of the last diagnosis.")
    ceiling: CeilingView | None = Field(None, description="Of the last model; null: not asked for.")
    next_take: NextTakeView | None
    sentences: list[str]

    @classmethod
    def of(cls, found: Improvement, models: Sequence[str | None] | None = None) -> ImprovementView:
        """``models``: the ids under which the steps' models were stored."""
        last = found.diagnosis
        ids = [None] * len(found.steps) if models is None else models
        held = None if last is None else last.hold_drift
        floors = found.noise_floor.items()
        return cls(
            steps=[StepView.of(step, id) for step, id in zip(found.steps, ids, strict=True)],
            baselines=dict(found.baselines),
            noise_floor_deg={name: floor.floor_deg for name, floor in floors},
            noise_floor_interval_deg={name: [floor.low_deg, floor.high_deg] for name, floor in floors},
            noise_floors={name: NoiseFloorView.of(floor) for name, floor in floors},
            stopped=found.stopped,
            undone=[AdditionView.of(item) for item in found.undone],
            hold_drift=None if held is None else HoldDriftView.of(held),
            unexplained_residual=None
            if last is None
            else UnexplainedResidualView.of(last.residual, is_noise(found)),
            next_take=NextTakeView.of(found.next_take),
            ceiling=CeilingView.of(found.ceiling),
            sentences=improvement_sentences(found),
        )
