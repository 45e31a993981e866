"""An examination as an answer shows it, and tables and pictures draw it."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from pydantic import BaseModel, Field

from glovecal_models.independence.coupling import LEAST_MAX_PCT, LEAST_STD_PCT, AffectingShare
from glovecal_models.independence.examination import RotationExamination
from glovecal_models.independence.independence import Independence
from glovecal_models.independence.proposal import Proposal, proposals, proposed_layout
from glovecal_models.independence.text import (
    doubt_sentences,
    independence_sentences,
    one_way_sentence,
    proposal_sentence,
    worn_side_sentence,
)
from glovecal_service.plain import plain


class ShareView(BaseModel):
    sensor: str
    std_pct: float | None
    std_low: float | None = Field(description="95 % interval, pieces of time weighted anew.")
    std_high: float | None
    max_pct: float | None
    max_low: float | None
    max_high: float | None
    affects: str = Field(description='By the 5 % and 12 % rule: "yes", "no" or "undecided".')
    moved_pct: float | None = Field(description="How much of its own range it was moved through.")
    rivals: list[str] = Field(description="Sensors that always moved along and could be the cause.")


class StillView(BaseModel):
    std_pct: float | None
    span_pct: float | None
    is_still: bool


class ActiveRangeView(BaseModel):
    readings: float | None
    source: str
    angle_deg: float | None


class ExaminedRotationView(BaseModel):
    rotation: str
    sensor: str
    takes: list[str]
    seconds: float
    std_pct: float | None = Field(description="Standard deviation, per cent of the active range.")
    max_pct: float | None
    is_coupled: bool
    unexplained_pct: float | None = Field(description="RMS that no other sensor explains.")
    affecting: list[ShareView]
    not_moved: list[str]
    still: StillView | None = Field(description="By measured angles; null where there are none.")
    active_range: ActiveRangeView
    doubts: list[str]


class OneWayView(BaseModel):
    affecting: str
    affected: str
    sentence: str


class WornSideView(BaseModel):
    verdict: str = Field(
        description='"as it should be", "other hand", "back to front" or "not identifiable".'
    )
    p_value: float | None = Field(description="That random signs agree so well.")
    reversed_sensors: list[str]
    sentence: str


class ProposalView(BaseModel):
    rotation: str
    kind: str
    sensors: list[str]
    kind_now: str
    sensors_now: list[str]
    is_sure: bool | None = Field(description="null: not examined, it stays as it is.")
    is_change: bool
    sentence: str


class RuleView(BaseModel):
    std_pct: float
    max_pct: float


class ExaminationView(BaseModel):
    layout: str
    rule: RuleView
    sensors: list[str]
    still: dict[str, list[str]]
    rotations: list[ExaminedRotationView]
    one_way: list[OneWayView]
    dead_sensors: list[str]
    worn_side: WornSideView
    proposals: list[ProposalView]
    proposed_layout: dict[str, Any] = Field(
        description="With the proposals that are sure; store it with PUT gloves/{layout}."
    )
    sentences: list[str] = Field(description="What is odd.")


def examination_view(found: Independence, layout_name: str) -> ExaminationView:
    """The proposed layout gets ``layout_name``. Per cents are of the still sensor's active range."""
    offered = proposals(found)
    side = found.worn_side
    facts = {
        "layout": found.layout.name,
        "rule": {"std_pct": LEAST_STD_PCT, "max_pct": LEAST_MAX_PCT},
        "sensors": found.layout.sensors,
        "still": found.still,
        "rotations": [_rotation(item) for item in found.rotations],
        "one_way": [
            {"affecting": first, "affected": second, "sentence": one_way_sentence(first, second)}
            for first, second in found.one_way
        ],
        "dead_sensors": found.dead_sensors,
        "worn_side": {**asdict(side), "sentence": worn_side_sentence(side)},
        "proposals": [_proposal(item) for item in offered],
        "proposed_layout": proposed_layout(found.layout, offered, layout_name).to_document(),
        "sentences": independence_sentences(found),
    }
    return ExaminationView.model_validate(plain(facts))


def _rotation(item: RotationExamination) -> dict[str, Any]:
    still, known = item.stillness, item.active_range
    return {
        **{name: getattr(item, name) for name in ("rotation", "sensor", "takes", "seconds")},
        **{name: getattr(item, name) for name in ("std_pct", "max_pct", "is_coupled", "not_moved")},
        "unexplained_pct": item.coupling.unexplained_pct,
        "affecting": [_share(share) for share in item.coupling.shares],
        "still": None if still is None else {**asdict(still), "is_still": still.is_still},
        "active_range": asdict(known),
        "doubts": doubt_sentences(item),
    }


def _share(share: AffectingShare) -> dict[str, Any]:
    return {**asdict(share), "affects": {True: "yes", False: "no", None: "undecided"}[share.affects]}


def _proposal(item: Proposal) -> dict[str, Any]:
    names = ("rotation", "kind", "sensors", "kind_now", "sensors_now", "is_sure", "is_change")
    return {**{name: getattr(item, name) for name in names}, "sentence": proposal_sentence(item)}
