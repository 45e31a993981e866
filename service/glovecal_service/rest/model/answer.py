"""Calibration models as REST gives them."""

from __future__ import annotations

from datetime import datetime
from typing import Any, Literal

from pydantic import Field

from glovecal_models.calibration.answer import ModelEffect
from glovecal_models.hand.rotations import Handedness
from glovecal_models.presentation.document import counted
from glovecal_service.plain import Row


class Model(Row):
    id: str = Field(description="sha256 of the artifact.")
    subject: str
    layout: str
    method: str
    parent: str | None
    hand: Handedness | None = Field(
        description="That of the takes it was trained on: a subject's gloves have models of their own. Null: "
        "nobody said it, and it reads both."
    )
    active: bool = Field(
        description="Whether live frames of the subject with the layout are predicted by it."
    )
    damage: str | None = Field(
        description="Why its artifact cannot be loaded, and what to do; found by the search for damage, or "
        "when the model was last asked for."
    )
    held_out_rmse_deg: float | None = Field(description="Error on takes left out of training, degrees.")
    rmse_unseen_wearing_deg: float | None = Field(
        description="Error in a wearing not seen in training, degrees; null: one wearing only, or unknown."
    )
    effects: list[str] = Field(description="Names of its effects, in the order in which they were added.")
    name: str = Field("", description="What people call it.")
    note: str = ""
    facts: dict[str, Any] = Field(description="Takes trained on, errors, how long it took ...")
    created_at: datetime

    @property
    def short(self) -> str:
        """The beginning of its id, by which people call it."""
        return self.id[:12]

    @property
    def sentences(self) -> list[str]:
        """What was said of it when it was made."""
        return self.facts.get("sentences", [])

    @property
    def trained_on(self) -> dict[str, str]:
        """Names of its takes by their ids."""
        return {take["id"]: take["name"] for take in self.facts.get("takes", ())}


class LineView(Row):
    """angle = offset_deg + the sum of scale times reading (Krnoul et al. 2016, Figure 1)."""

    scale_deg: dict[str, float] = Field(description="Degrees a count, by what is read.")
    offset_deg: float = Field(description="The angle at reading zero.")


class KernelScoreView(Row):
    kernel: str
    words: str
    chosen: bool
    nlml: float = Field(description="Negative log marginal likelihood, nats, of densities per degree.")
    evidence_gain: float = Field(description="Nats over the first candidate, after a price per parameter.")
    held_out_rmse_deg: float | None = Field(description="On takes left out of the trial, degrees.")


class KernelChoiceView(Row):
    sentence: str
    samples: int = Field(description="On which all candidates were tried.")
    straight_line_deg: float | None = Field(description="Held-out error of a straight line, degrees.")
    spread_deg: float | None = Field(description="Error of always saying the mean angle, degrees.")
    candidates: list[KernelScoreView]


class Rotation(Row):
    rotation: str
    kind: str = Field(description="1S1R, MS1R, 0S1R or MSMR.")
    sensors: list[str]
    method: str
    held_out_rmse_deg: float | None
    noise_deg: float | None = Field(description="Standard deviation of the measurement noise.")
    uncertain_above_deg: float
    samples: int
    kernel_choice: KernelChoiceView | None = Field(description="Of a model trained with `auto`, else null.")
    line: LineView | None = Field(description="Of a linear rotation or a template's equation, else null.")


class UnseenWearingView(Row):
    rmse_unseen_wearing_deg: float | None = Field(
        description="Each wearing left out whole; null: one wearing only, or not estimated."
    )
    interval_deg: list[float] | None = Field(description="95 % interval of the error in one more wearing.")
    rmse_deg: float | None = Field(description="On held-out takes of the wearings seen.")
    wearings: list[str] = Field(description="Of the training takes.")
    per_rotation: dict[str, float] = Field(description="RMSE by rotation, each wearing left out whole.")
    per_wearing: dict[str, float] = Field(description="RMSE in each wearing, left out whole.")
    between_sd_deg: dict[str, float] = Field(description="Standard deviation between wearings, by rotation.")
    freedom: float = Field(description="Degrees of freedom of the t distribution of the next wearing.")
    sentences: list[str]


class ModelInFull(Model):
    rotations: list[Rotation]
    effect_details: list[ModelEffect]
    simulated: bool = Field(description="Whether any training take came from a simulated glove.")
    error_estimate: dict[str, Any]
    unseen_wearing: UnseenWearingView | None = Field(description="Null for a model of an earlier version.")


class ActivationView(Row):
    id: int
    subject: str
    layout: str
    model: str
    kind: Literal["activate", "rollback"]
    previous: int | None
    created_at: datetime


class ImportedModel(Row):
    model: Model
    is_new: bool = Field(description="False: the very same model was here before.")
    layout_is_new: bool
    subject_created: bool


class ImportedCalibration(ImportedModel):
    left_out: dict[str, str] = Field(
        description="Sensors of the file that the layout does not read, and why."
    )
    doubts: dict[str, str] = Field(
        description="Sensors whose line misses points of the file, and by how much."
    )


class CalibratedRotation(Row):
    """angle = gain_deg x (reading - zero)."""

    rotation: str
    sensor: str
    gain_deg: float = Field(description="Degrees a count.")
    zero: float = Field(description="The reading at which it is 0 degrees, counts.")


class CalibrationPreview(Row):
    format: str
    title: str = Field(description="Whose format it is.")
    layouts: list[str] = Field(description="Gloves that it can be of; those of most rotations first.")
    layout: str = Field(description="Of the glove that it is read for.")
    subject: str = Field(description="Whose model it would become.")
    hand: Handedness = Field(description="Which the signs are read for.")
    rotations: list[CalibratedRotation]
    left_out: dict[str, str] = Field(description="Sensors without a line, and why.")
    misses: dict[str, str] = Field(description="Sensors whose line misses points of the file.")

    @property
    def sentence(self) -> str:
        return (
            f"{self.title}: {counted(len(self.rotations), 'rotation')} of glove {self.layout}, "
            f"{self.hand} hand. It becomes a linear model of {self.subject}, whose error nobody knows yet."
        )


class CalibrationFile(Row):
    text: str
    left_out: dict[str, str] = Field(description="Rotations that the format cannot say, and why.")


class ReplayView(Row):
    model: str
    take: str
    name: str
    rotations: list[str] = Field(description="Every rotation of the hand, the columns of both hands.")
    time_s: list[float] = Field(description="By the take's clock.")
    measured_deg: list[list[float | None]]
    predicted_deg: list[list[float | None]] = Field(
        description="Where a rotation was not predicted and measured both hands have the same angle; the "
        "wrist is straight."
    )
    tips_mm: dict[str, list[float | None]] = Field(
        description="Distance of the two tips of each finger whose chain was predicted and measured."
    )
    hand_length_mm: float
    is_assumed: bool = Field(description="This subject's hand was not measured.")
    sentence: str
