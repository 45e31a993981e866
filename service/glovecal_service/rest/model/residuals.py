"""``models/{id}/series``, ``residual`` and ``replay``: what a model leaves of some takes, to be drawn."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from fastapi import APIRouter
from pydantic import Field, FiniteFloat

from glovecal_models.comparison.dependence import covariates, dependence, joint_columns
from glovecal_models.comparison.fingertips import HandPoses, poses_of_take, tips_mm
from glovecal_models.comparison.series.answer import ResidualColumn, Series, residual_against, series_of
from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import FINGERS, HAND_ROTATIONS
from glovecal_models.hand.skeleton import Skeleton
from glovecal_models.presentation.document import TakeNamed
from glovecal_service.plain import plain
from glovecal_service.questions.chosen_takes import TakesNamed
from glovecal_service.request_types import ONE_LINE, Channel, StrictBody, TakeReference
from glovecal_service.rest.http.dependencies import PartsNeeded
from glovecal_service.rest.http.problem import change_problems
from glovecal_service.rest.http.request_types import ModelInPath
from glovecal_service.rest.model.answer import ReplayView
from glovecal_service.rest.model.comparison import compared_takes
from glovecal_service.store.records import TakeRecord

router = APIRouter(prefix="/models", tags=["models"])


class SeriesRequest(StrictBody):
    takes: TakesNamed
    rotation: Channel
    from_s: FiniteFloat | None = Field(None, description="Begin of a window on the linked axis; null: all.")
    to_s: FiniteFloat | None = Field(None, description="Its end.")
    points: Annotated[int, Field(ge=100, le=4000)] = Field(2000, description="At most, over all takes.")


@router.post(
    "/{id}/series",
    response_model=Series,
    summary="One rotation over time: measured, predicted, error",
    responses=change_problems(409),
)
def series_of_rotation(id: ModelInPath, body: SeriesRequest, parts: PartsNeeded) -> Series:
    """Takes after one another on a linked axis. Where there are more frames than points, the lowest and the
    highest of measured, predicted and error are kept in every part of the window.

    A take has at least 20 points where it has so many frames in the window.
    """
    on = compared_takes(id, body.takes, body.rotation, parts)
    window = (-math.inf if body.from_s is None else body.from_s, math.inf if body.to_s is None else body.to_s)
    rows = [TakeNamed(take.id, take.name) for take in on.takes]
    return series_of(
        on.found, rows, on.model.id, body.rotation,
        window_s=window, points=body.points, trained_on=on.trained_on,
    )  # fmt: skip


class OneColumn(StrictBody):
    takes: TakesNamed
    rotation: Channel
    column: Annotated[str, Field(min_length=1, max_length=200, pattern=ONE_LINE)] = Field(
        "angle",
        description="`angle`, `speed`, `direction`, `time in take`, `time since power-on`, `sensor NAME`, "
        "`context NAME` or `joint NAME`; the answer lists all.",
    )
    seed: Annotated[int, Field(ge=0, le=2**31 - 1)] = Field(0, description="Of the circular shifts.")


@router.post(
    "/{id}/residual",
    response_model=ResidualColumn,
    summary="One rotation's error against a recorded column",
    responses=change_problems(409),
)
def residual_against_column(id: ModelInPath, body: OneColumn, parts: PartsNeeded) -> ResidualColumn:
    """Mean error in bins of the column, and how far 95 % of circularly shifted errors take such a mean.

    422 for a rotation that none of the takes measured and for a column that they do not have.
    """
    on = compared_takes(id, body.takes, body.rotation, parts)
    if body.rotation not in on.found.measured_rotations:
        raise BadInput(f"none of the takes measured {body.rotation}")
    columns = [*covariates(on.found, body.rotation), *joint_columns(on.found, body.rotation)]
    chosen = next((one for one in columns if one.name == body.column), None)
    if chosen is None:
        names = ", ".join(one.name for one in columns)
        raise BadInput(f"these takes have no column {body.column!r}; there are {names}")
    number = on.found.column(body.rotation)
    errors = tuple(item.error[:, number] for item in on.found.takes)
    tested = dependence(errors, chosen, np.random.default_rng(body.seed))
    return residual_against(on.found, on.model.id, body.rotation, columns, chosen, tested)


class ReplayedStretch(StrictBody):
    take: TakeReference
    from_s: FiniteFloat = Field(description="Seconds by the take's clock.")
    to_s: FiniteFloat
    frames: Annotated[int, Field(ge=1, le=1200)] = Field(600, description="At most, evenly chosen.")


@router.post(
    "/{id}/replay",
    response_model=ReplayView,
    summary="A stretch of a take as two hands",
    responses=change_problems(409),
)
def replay_stretch(id: ModelInPath, body: ReplayedStretch, parts: PartsNeeded) -> ReplayView:
    """Angles of both hands frame by frame, and the distance of their fingertips in mm.

    The nearest frame where none lies between the two times; 422 for times outside the take.
    """
    on = compared_takes(id, [body.take], None, parts)
    [item], [row] = on.found.takes, on.takes
    time = item.take.time_s
    if body.from_s > body.to_s or body.to_s < time[0] or body.from_s > time[-1]:
        raise BadInput(
            f"take {row.name!r} lasts from {time[0]:g} to {time[-1]:g} s; {body.from_s:g} to {body.to_s:g} s "
            "is no stretch of it"
        )
    inside = np.flatnonzero((time >= body.from_s) & (time <= body.to_s))
    if not len(inside):
        inside = np.array([np.argmin(np.abs(time - body.from_s))])
    frames = inside[:: max(1, -(-len(inside) // body.frames))]
    poses = poses_of_take(item, on.found.rotations).at(frames)
    skeleton = parts.store.subjects.get(on.model.subject).skeleton(row.known_hand)
    return _replay(poses, time[frames], skeleton, on.model.id, row)


def _replay(
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
