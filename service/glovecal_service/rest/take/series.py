"""``takes/{id}/series`` and ``hand``: a take as it is drawn, and what its hand does as it is replayed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any

import numpy as np
from fastapi import APIRouter, Query
from fastapi.responses import JSONResponse

from glovecal_models.errors import BadInput
from glovecal_models.presentation.document import counted
from glovecal_models.takes.answer import TakeSeries
from glovecal_models.takes.take import Take
from glovecal_models.takes.take_series import take_series
from glovecal_service.exports.motion_file import motion_of
from glovecal_service.plain import document_of, plain
from glovecal_service.questions.model_work import model_title
from glovecal_service.request_types import SHA256_PREFIX
from glovecal_service.rest.http.dependencies import Parts, PartsNeeded, StoreNeeded
from glovecal_service.rest.http.problem import problems
from glovecal_service.rest.http.request_types import IdInPath
from glovecal_service.rest.take.answer import HandOverTime
from glovecal_service.store.records import TakeRecord

router = APIRouter(prefix="/takes", tags=["takes"])


@router.get(
    "/{id}/series",
    response_model=TakeSeries,
    summary="Readings and reference over time, as they are drawn",
    responses=problems(),
)
def get_series(
    id: IdInPath,
    store: StoreNeeded,
    from_s: Annotated[float | None, Query(ge=0, description="Seconds since its first frame.")] = None,
    to_s: Annotated[float | None, Query(ge=0)] = None,
    points: Annotated[int, Query(ge=100, le=20_000, description="Frames at most, and rows.")] = 2000,
) -> JSONResponse:
    """Of many frames those that hold each sensor's lowest and highest reading: no extreme is lost."""
    take, left_out = store.takes.load_recorded(id), store.takes.get(id).left_out
    answer = take_series(take, from_s=from_s, to_s=to_s, points=points)
    return JSONResponse(document_of(replace(answer, left_out=left_out)))


PART_S = 30.0
SHOWN_HZ = 65.0
"""At most; a glove of 60 frames a second is shown whole."""
BEFORE_S = 60.0
"""What effects with a memory are told of before a part."""
RAW = (
    "Nothing was measured, and there is no model: readings alone. Each joint goes linearly from its sensor's "
    "least to its greatest reading in this take; what hardly moves rests."
)


@router.get(
    "/{id}/hand",
    response_model=HandOverTime,
    summary="What the hand of a take does, part by part",
    responses=problems(409),
)
def get_hand(
    id: IdInPath,
    parts: PartsNeeded,
    from_s: Annotated[float, Query(ge=0, description="Seconds since its first frame.")] = 0.0,
    model: Annotated[
        str | None, Query(pattern=SHA256_PREFIX, description="Whose poses, where nothing was measured.")
    ] = None,
) -> JSONResponse:
    """Measured angles where the take has some; else the poses of the model; else readings. At most 30 s and
    60 frames a second: `to_s` is where the next part begins. What people left out is there, too."""
    record, take = parts.store.takes.get(id), parts.store.takes.load_recorded(id)
    if from_s > take.duration_s:
        raise BadInput(
            f"take {record.name!r} lasts {take.duration_s:.2f} s: give a from_s inside it, not {from_s:g}"
        )
    time = take.time_s - take.time_s[0]
    rate_hz = 1.0 / float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    inside = np.flatnonzero((time >= from_s) & (time < from_s + PART_S))
    frames = inside[:: max(1, math.ceil(rate_hz / SHOWN_HZ))]
    spans = list(zip(take.readings.min(axis=0).tolist(), take.readings.max(axis=0).tolist(), strict=True))
    answer = HandOverTime(
        source="raw", model=None, from_s=from_s, to_s=min(from_s + PART_S, take.duration_s),
        names=list(take.sensors), time_s=np.round(time[frames], 4).tolist(),
        values=take.readings[frames].tolist(), spans=spans, sentence=RAW,
    )  # fmt: skip
    if record.has_reference:
        angles = take.reference_at_frames(record.rotations)[frames]
        sentence = f"Measured: {counted(len(record.rotations), 'rotation')}; all others rest."
        answer = answer.model_copy(
            update={"source": "reference", **_angles(record.rotations, angles, sentence)}
        )
    elif model is not None:
        answer = answer.model_copy(update={"source": "model", **_posed(parts, record, take, frames, model)})
    return JSONResponse(document_of(answer))


def _posed(parts: Parts, record: TakeRecord, take: Take, frames: np.ndarray, model: str) -> dict[str, Any]:
    """Angles by a model. Raises NotFound, LayoutMismatch, DamagedArtifact."""
    id, at = parts.store.models.get(model).id, take.time_s[frames]
    first = float(at[0]) - BEFORE_S if len(at) else np.inf
    wanted = (take.time_s >= first) & (take.time_s <= (at[-1] if len(at) else first))
    part = replace(take.some(wanted, np.zeros(len(take.reference_time_s), bool)), begins_s=None)
    skeleton = parts.store.subjects.get(record.subject).skeleton(record.known_hand)
    motion = motion_of(part, parts.predictors.get(id)[0], skeleton, "hand")
    sentence = f"Nothing was measured: the poses of {model_title(parts.store, id)}."
    angles = motion.degrees[np.searchsorted(motion.time_s, at)]
    return {"model": id, **_angles(motion.rotations, angles, sentence)}


def _angles(rotations: Sequence[str], angles: np.ndarray, sentence: str) -> dict[str, Any]:
    values = plain(np.round(angles, 2))
    return {"names": list(rotations), "values": values, "spans": [], "sentence": sentence}
