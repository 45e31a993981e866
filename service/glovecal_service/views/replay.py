"""A stretch of a take as two hands, measured and predicted, as an answer shows it."""

from __future__ import annotations

import numpy as np
from pydantic import BaseModel, Field

from glovecal_models.comparison.hand_poses import HandPoses, tips_mm
from glovecal_models.hand.rotations import FINGERS, HAND_ROTATIONS
from glovecal_models.hand.skeleton import Skeleton
from glovecal_service.plain import plain
from glovecal_service.store.records import TakeRecord


class ReplayView(BaseModel):
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


def replay_view(
    poses: HandPoses, time_s: np.ndarray, skeleton: Skeleton, model: str, take: TakeRecord
) -> ReplayView:
    """``time_s`` (N,): of the frames of ``poses``, by the take's clock."""
    measured, predicted = (tips_mm(skeleton, angles) for angles in (poses.measured, poses.predicted))
    off = np.where(poses.counts, np.linalg.norm(predicted - measured, axis=2), np.nan)
    fingers = [name for number, name in enumerate(FINGERS.values()) if poses.counts[:, number].any()]
    columns = list(FINGERS.values())
    sentence = "No finger's chain was predicted and measured here: no distance of fingertips."
    if fingers:
        frame, worst = np.unravel_index(np.nanargmax(off), off.shape)
        when = f", {time_s[frame] - time_s[0]:.2f} s into the stretch" if len(time_s) > 1 else ""
        size = ", an assumed size" if skeleton.dimensions.is_assumed else ""
        sentence = (
            f"Fingertips are up to {off[frame, worst]:.1f} mm apart ({columns[worst]}{when}; a hand of "
            f"{skeleton.dimensions.hand_length_mm:.0f} mm{size})."
        )
    return ReplayView(
        model=model,
        take=take.id,
        name=take.name,
        rotations=list(HAND_ROTATIONS),
        time_s=time_s.tolist(),
        measured_deg=plain(poses.measured),
        predicted_deg=plain(poses.predicted),
        tips_mm={name: plain(off[:, columns.index(name)]) for name in fingers},
        hand_length_mm=skeleton.dimensions.hand_length_mm,
        is_assumed=skeleton.dimensions.is_assumed,
        sentence=sentence,
    )
