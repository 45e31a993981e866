"""A diagnosis: errors in degrees, on held-out takes, readings and reference identically smoothed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pydantic import Field

from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.diagnosis.actions import Action
from glovecal_models.diagnosis.camera_errors import CAMERA
from glovecal_models.diagnosis.diagnosis import Diagnosis, Verdict
from glovecal_models.diagnosis.floor_ratio import FloorRatio
from glovecal_models.diagnosis.text import (
    action_sentence,
    candidate_sentence,
    diagnosis_sentences,
    named_sentence,
    residual_obstacle,
    residual_sentence,
)
from glovecal_models.diagnosis.unexplained_residual import UnexplainedResidual
from glovecal_models.effects.base.assessment import Assessment
from glovecal_models.effects.base.signature_effect import Finding
from glovecal_service.views.camera_range import CameraRangeView, camera_range_views
from glovecal_service.views.ceiling import CeilingView
from glovecal_service.views.hold_drift import HoldDriftView
from glovecal_service.views.next_take import NextTakeView
from glovecal_service.views.noise_floor import NoiseFloorView
from glovecal_service.views.training import EffectView
from glovecal_service.views.view import View


class RotationErrorView(View):
    rmse_deg: float | None
    noise_floor_deg: float | None = None
    floor: NoiseFloorView | None = Field(
        None, description="Of errors that are not smoothed, as `compare` tells it of the same takes."
    )


def _rotation(rmse_deg: float, floor: NoiseFloor | None) -> RotationErrorView:
    if floor is None:
        return RotationErrorView(rmse_deg=rmse_deg, floor=None)
    return RotationErrorView(
        rmse_deg=rmse_deg, noise_floor_deg=floor.floor_deg, floor=NoiseFloorView.of(floor)
    )


class NamedEffectView(View):
    effect: str
    where: list[str] = Field(description="Rotations; sensors or takes where it is a fault of those.")
    kind: str | None = Field(
        None,
        description="As in the catalogue; finding: nothing to add, to be put right at the glove; null: named"
        " by drift in held poses.",
    )
    verdict: Verdict
    confidence_set: list[str] = Field(description="It, and all that these takes cannot tell from it.")
    parameters: dict[str, Any] = Field(description="Learned numbers, units in their names.")
    saved_deg: float | None = Field(description="Saved of the smoothed error; null: found by its signature.")
    control_saved_deg: float | None = Field(None, description="The same of its control.")
    method: str | None = Field(
        None, description="To be trained with: its base learns the effect by itself, a straight line cannot."
    )
    sentence: str

    @classmethod
    def of(cls, diagnosis: Diagnosis) -> NamedEffectView | None:
        named = diagnosis.named
        if named is None:
            return None
        return cls(
            effect=named.effect,
            where=list(named.where),
            kind=named.kind,
            verdict=named.verdict,
            confidence_set=list(named.confidence_set),
            parameters=dict(named.parameters),
            saved_deg=named.saved_deg,
            control_saved_deg=named.control_saved_deg,
            method=named.method,
            sentence=named_sentence(diagnosis) or "",
        )


class CandidateView(View):
    effect: str
    where: list[str] = Field(description="Rotations on which it beats its control significantly.")
    rmse_before_deg: float | None = Field(description="Smoothed error on held-out takes without it.")
    rmse_after_deg: float | None = Field(description="With it.")
    rmse_control_deg: float | None = Field(None, description="With its control instead.")
    saved_share: dict[str, float | None] = Field({}, description="Of the squared error, for each rotation.")
    control_saved_share: dict[str, float | None] = Field({}, description="The same of its control.")
    p_value: float | None = Field(None, description="By permuting takes; null: tested block by block.")
    passes: bool = Field(description="Whether it is significant on any rotation.")
    sentence: str = ""

    @classmethod
    def of(cls, item: Assessment) -> CandidateView:
        rmse = item.rmse_deg
        errors = list(zip(item.joints, item.errors, strict=True))
        return cls(
            effect=item.effect,
            where=[item.joints[i] for i in item.significant_joints],
            rmse_before_deg=rmse.before,
            rmse_after_deg=rmse.after,
            rmse_control_deg=rmse.control,
            saved_share={name: error.saved for name, error in errors},
            control_saved_share={name: error.control_saved for name, error in errors},
            p_value=item.p_value,
            passes=bool(item.significant_joints),
            sentence=candidate_sentence(item),
        )


class NotIdentifiableView(View):
    effect: str
    why: str


class StretchView(View):
    take: str
    start_s: float | None
    end_s: float | None


class FindingView(View):
    """What is known by a signature in the recording."""

    effect: str
    kind: str = Field("", description='Which of the effect\'s signatures, such as "stuck".')
    where: list[str]
    sentence: str
    stretches: list[StretchView] = Field([])

    @classmethod
    def of(cls, item: Finding) -> FindingView:
        return cls(
            effect=item.effect,
            kind=item.kind,
            where=list(item.where),
            sentence=item.sentence,
            stretches=[
                StretchView(take=part.take, start_s=part.start_s, end_s=part.end_s) for part in item.stretches
            ],
        )


def _of_camera(diagnosis: Diagnosis) -> list[FindingView]:
    """An error that is the camera's, first of all: no effect of the glove."""
    camera = diagnosis.camera
    if camera is None or not camera.joints:
        return []
    return [
        FindingView(
            effect=CAMERA, kind="deviation", where=list(camera.joints), sentence=camera.sentence, stretches=[]
        )
    ]


class AssociationView(View):
    """A recorded column that the residual depends on."""

    rotation: str
    column: str = Field(description='As in `where`: "angle", "sensor NAME", "context NAME", "wearing".')
    phrase: str
    size_deg: float | None = Field(description="Root mean square that it explains beyond chance.")
    p_value: float | None = Field(description="Corrected for all columns and rotations tested.")


class ActionView(View):
    """What an association of the residual asks for."""

    rotation: str
    column: str = Field(description="As in `where`.")
    phrase: str = Field("", description="The column in words.")
    effect: str | None = Field(description="To be added on the rotation; null where only `method` helps.")
    is_physical: bool = Field(description="False: the effect only names a column, no cause is claimed.")
    method: str | None = Field(
        description="To be trained with rather: a straight line cannot use the column."
    )
    rmse_before_deg: float | None = Field(description="Of the rotation's sensor, on takes held out whole.")
    rmse_after_deg: float | None = Field(description="With the effect, in the form that the takes ask for.")
    rmse_control_deg: float | None = Field(description="With its control, of the same form and freedom.")
    saves: bool = Field(description="Whether the effect beats its control.")
    is_within_known: bool = Field(
        description="Whether the model's own effects may have left as much; improve does not add it then."
    )
    sentence: str

    @classmethod
    def of(cls, item: Action) -> ActionView:
        found = item.rmse_deg
        return cls(
            rotation=item.rotation,
            column=item.association.column,
            phrase=item.association.phrase,
            effect=item.effect,
            is_physical=item.is_physical,
            method=item.method,
            rmse_before_deg=None if found is None else found.before,
            rmse_after_deg=None if found is None else found.after,
            rmse_control_deg=None if found is None else found.control,
            saves=item.saves,
            is_within_known=item.is_within_known,
            sentence=action_sentence(item),
        )


class FloorRatioView(View):
    """An error that is left, beside its noise floor."""

    rmse_deg: float | None = Field(description="Smoothed error on held-out takes.")
    times_floor: float | None = Field(description="Over the noise floor.")
    lower_times_floor: float | None = Field(
        description="Its lower 95 % bound over the upper end of the floor's interval."
    )
    is_judgeable: bool = Field(description="Whether the floor is reliable and enough was measured.")

    @classmethod
    def of(cls, item: FloorRatio) -> FloorRatioView:
        return cls(
            rmse_deg=item.rmse_deg,
            times_floor=item.times,
            lower_times_floor=item.lower_times,
            is_judgeable=item.is_judgeable,
        )


class UnexplainedResidualView(View):
    is_significant: bool
    sentence: str
    not_identifiable: str | None = Field(None, description="Why these takes cannot tell.")
    associations: list[AssociationView] = Field([])
    floor_ratios: dict[str, FloorRatioView] = Field({}, description="For each rotation with a known floor.")

    @classmethod
    def of(
        cls,
        residual: UnexplainedResidual,
        is_noise: bool | None = None,
        by_column: Sequence[Action] = (),
    ) -> UnexplainedResidualView:
        """``is_noise``: of the errors shown beside it; None: the residual's own. ``by_column``: of an effect
        that is named by it."""
        return cls(
            is_significant=residual.is_significant,
            sentence=residual_sentence(residual, is_noise, by_column),
            floor_ratios={name: FloorRatioView.of(item) for name, item in residual.floor_ratios.items()},
            not_identifiable=residual_obstacle(residual),
            associations=[
                AssociationView(
                    rotation=item.rotation,
                    column=item.column,
                    phrase=item.phrase,
                    size_deg=item.size_deg,
                    p_value=item.p_value,
                )
                for item in residual.associations
            ],
        )


class DiagnosisView(View):
    rotations: dict[str, RotationErrorView]
    named: NamedEffectView | None
    candidates: list[CandidateView] = Field(description="Every effect that was compared, the best first.")
    not_identifiable: list[NotIdentifiableView]
    findings: list[FindingView] = Field([])
    camera_ranges: list[CameraRangeView] = Field(
        [], description="Of rotations that a camera measured: angles outside of these ranges are not judged."
    )
    reference_problems: list[str] = Field([])
    hold_drift: HoldDriftView | None = None
    unexplained_residual: UnexplainedResidualView | None
    next_take: NextTakeView | None
    actions: list[ActionView] = Field([], description="One for each association, what saves most first.")
    sentences: list[str] = Field(description="What to know, the most important first.")

    @classmethod
    def of(cls, diagnosis: Diagnosis) -> DiagnosisView:
        held = diagnosis.hold_drift
        return cls(
            rotations={
                name: _rotation(value, diagnosis.noise_floors.get(name))
                for name, value in diagnosis.rmse_deg.items()
            },
            named=NamedEffectView.of(diagnosis),
            candidates=[CandidateView.of(item) for item in diagnosis.ranked_assessments],
            not_identifiable=[
                NotIdentifiableView(effect=item.effect, why=item.why) for item in diagnosis.not_identifiable
            ],
            findings=[*_of_camera(diagnosis), *(FindingView.of(item) for item in diagnosis.findings)],
            camera_ranges=[
                CameraRangeView.model_validate(item)
                for item in camera_range_views(() if diagnosis.camera is None else diagnosis.camera.ranges)
            ],
            reference_problems=list(diagnosis.reference_problems),
            hold_drift=None if held is None else HoldDriftView.of(held),
            unexplained_residual=UnexplainedResidualView.of(
                diagnosis.residual, by_column=diagnosis.by_column
            ),
            next_take=NextTakeView.of(diagnosis.next_take),
            actions=[ActionView.of(item) for item in diagnosis.actions],
            sentences=diagnosis_sentences(diagnosis),
        )


class TakeNamed(View):
    id: str
    name: str


class OddTakeView(View):
    id: str
    take: str = Field(description="Its name.")
    sentence: str
    how: str = Field(
        description="What makes it fit: signs, sensors or rotations (columns in another order),"
        " columns (either), gains, own map, another subject; level: its readings lie elsewhere; nothing."
    )
    error_deg: float = Field(description="Of a line through the other takes.")
    usual_deg: float = Field(description="The same of the other takes, at most.")
    fitted_deg: float = Field(description="With what makes it fit.")


class DiagnosisResult(DiagnosisView):
    """Of a ``diagnose`` job."""

    model: str
    method: str | None = None
    odd_takes: list[OddTakeView] = Field(
        [], description="Takes that do not fit the others; nothing else was judged on them."
    )
    excluded: list[str] = Field(
        [], description="On reference angles that jump away and come back: they neither train nor score."
    )
    takes: list[TakeNamed] = Field([])
    model_effects: list[EffectView] = Field([], description="What the model has learned already.")
    ceiling: CeilingView | None = Field(None, description="Of the model; null: not asked for yet.")
