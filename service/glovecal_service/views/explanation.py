"""What an angle is made of, as an answer shows it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict

from pydantic import BaseModel, Field

from glovecal_models.calibration.explanation import (
    AngleTerms,
    Explanation,
    FrameExplanation,
    Measured,
    TermKind,
)
from glovecal_models.calibration.text import angle_sentences, frame_sentences


class TermView(BaseModel):
    name: str = Field(description="`base`, an effect, or `measurement noise`.")
    kind: TermKind = Field(
        description="`base`: the regressor alone; `held`: from what a faulty sensor says to the last good "
        "angle; `correction`: an effect; `noise` and `interval` change the standard deviation only."
    )
    degrees: float
    sd_deg: float | None = Field(description="Null where the model does not store it; see `variance_deg2`.")
    variance_deg2: float | None = Field(
        description="Degrees squared; negative where an effect explains a part of the measurement noise."
    )
    is_claimed: bool = Field(description="Whether its variance is in the angle's `sd_deg`.")


class RepairView(BaseModel):
    name: str
    degrees: float | None = Field(
        description="What it changes of the measured angle. Null: it takes the measurement here away."
    )


class MeasuredView(BaseModel):
    recorded_deg: float
    repairs: list[RepairView] = Field(
        description="Effects that repair measurements before they are compared."
    )
    degrees: float | None = Field(description="After the repairs; null: not compared.")
    error_deg: float | None = Field(description="Predicted minus measured.")


class AngleView(BaseModel):
    rotation: str
    degrees: float = Field(description="The predicted angle: the sum of the terms' degrees.")
    sd_deg: float = Field(description="Of a measurement of the rotation, its noise included.")
    flags: int = Field(description="Sum of 1 extrapolating, 2 too uncertain, 4 by rule, 8 faulty sensor.")
    terms: list[TermView] = Field(description="In the order in which they are applied.")
    readings: dict[str, float] = Field(
        description="Raw reading of each sensor that the base reads, as the glove sends it."
    )
    sources: list[str] = Field(description="Rotations that it is computed from by rule.")
    measured: MeasuredView | None
    sentences: list[str]


class LiveExplanationView(BaseModel):
    glove: str
    model: str
    run_id: str = Field(description="16 hexadecimal digits, with `sequence` the frame and its pose.")
    sequence: int
    settling_s: float = Field(
        description="So long after a start effects with a memory are uncertain; 0: none has a memory."
    )
    transient_s: float | None = Field(
        description="How long ago they started, while they have not settled; else null."
    )
    faulty_sensors: list[str]
    rotations: list[AngleView]
    sentences: list[str] = Field(description="What holds for all rotations of the frame.")


class ExplanationView(BaseModel):
    model: str
    take: str
    name: str
    wearing: str
    simulated: bool
    frame: int = Field(description="Number of the frame in the take, 0 for the first.")
    time_s: float = Field(description="Of the frame, by the take's clock; the one nearest to the time asked.")
    settling_s: float = Field(
        description="So long after a start effects with a memory are uncertain; 0: none has a memory."
    )
    faulty_sensors: list[str]
    rotations: list[AngleView]
    sentences: list[str] = Field(description="What holds for all rotations of the frame.")


def explanation_view(found: Explanation, model: str, take: str, rotations: Sequence[str]) -> ExplanationView:
    """Of the take with the id ``take`` and the model with the id ``model``; only ``rotations``."""
    frame = found.frame
    return ExplanationView(
        model=model,
        take=take,
        name=found.take,
        wearing=found.wearing,
        simulated=found.simulated,
        frame=found.number,
        time_s=frame.time_s,
        settling_s=frame.settling_s,
        faulty_sensors=list(frame.faulty_sensors),
        rotations=[
            _angle(angle, found.measured.get(angle.rotation))
            for angle in frame.angles
            if angle.rotation in rotations
        ],
        sentences=frame_sentences(frame),
    )


def live_explanation_view(
    frame: FrameExplanation, *, glove: str, model: str, run_id: int, sequence: int, rotations: Sequence[str]
) -> LiveExplanationView:
    """Of a pose that was served; only ``rotations``."""
    return LiveExplanationView(
        glove=glove,
        model=model,
        run_id=f"{run_id:016x}",
        sequence=sequence,
        settling_s=frame.settling_s,
        transient_s=frame.transient_s,
        faulty_sensors=list(frame.faulty_sensors),
        rotations=[_angle(angle, None) for angle in frame.angles if angle.rotation in rotations],
        sentences=frame_sentences(frame),
    )


def _angle(angle: AngleTerms, measured: Measured | None) -> AngleView:
    shown = None
    if measured is not None:
        error = None if measured.degrees is None else angle.degrees - measured.degrees
        shown = MeasuredView(**asdict(measured), error_deg=error)
    return AngleView(
        rotation=angle.rotation,
        degrees=angle.degrees,
        sd_deg=angle.sd_deg,
        flags=angle.flags,
        terms=[
            TermView(
                name=item.name,
                kind=item.kind,
                degrees=item.degrees,
                sd_deg=item.sd_deg,
                variance_deg2=item.variance,
                is_claimed=item.is_claimed,
            )
            for item in angle.terms
        ],
        readings=dict(angle.readings),
        sources=list(angle.sources),
        measured=shown,
        sentences=angle_sentences(angle, measured),
    )
