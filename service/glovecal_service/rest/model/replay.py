"""``models/{id}/replay``: a stretch of a take as a measured and a predicted hand."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from fastapi import APIRouter
from pydantic import Field, FiniteFloat

from glovecal_models.comparison.hand_poses import poses_of_take
from glovecal_models.errors import BadInput
from glovecal_service.rest.http.answers import change_problems
from glovecal_service.rest.http.dependencies import PartsNeeded
from glovecal_service.rest.http.request_types import ModelInPath, StrictBody, TakeReference
from glovecal_service.rest.model.compared_takes import compared_takes
from glovecal_service.views.replay import ReplayView, replay_view

router = APIRouter(prefix="/models", tags=["models"])


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
    return replay_view(poses, time[frames], skeleton, on.model.id, row)
