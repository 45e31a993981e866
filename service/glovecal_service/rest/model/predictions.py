"""``models/{id}/predict``: rotations of readings that are sent, one by one or as a take."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from fastapi import APIRouter
from pydantic import BaseModel, Field, FiniteFloat

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.errors import BadInput, LayoutMismatch
from glovecal_models.sampling.inverse_kinematics.follow import steadied
from glovecal_service.plain import plain
from glovecal_service.request_types import Channel, StrictBody, WearingName
from glovecal_service.rest.http.dependencies import PartsNeeded
from glovecal_service.rest.http.problem import change_problems
from glovecal_service.rest.http.request_types import ModelInPath

router = APIRouter(prefix="/models", tags=["models"])

MOST_FRAMES = 20_000
MOST_SENSORS = 512
MOST_CONTEXT = 256
LONGEST_STEADIED_S = 2.0


class Readings(StrictBody):
    readings: Annotated[
        list[Annotated[list[FiniteFloat], Field(max_length=MOST_SENSORS)]],
        Field(min_length=1, max_length=MOST_FRAMES, description="Frames of raw readings."),
    ]
    sensors: Annotated[list[Channel], Field(max_length=MOST_SENSORS)] | None = Field(
        None, description="Order of the readings; None: that of the model's layout."
    )
    time_s: Annotated[list[FiniteFloat], Field(max_length=MOST_FRAMES)] | None = Field(
        None,
        description="When each frame was read, seconds of any origin, increasing: the frames are one take. "
        "Needed by models with effects that remember (hysteresis, creep, lag ...), which begin at its first "
        "frame, and again after more than 1 s without one.",
    )
    context: (
        Annotated[
            dict[Channel, Annotated[list[FiniteFloat | None], Field(max_length=MOST_FRAMES)]],
            Field(max_length=MOST_CONTEXT),
        ]
        | None
    ) = Field(
        None,
        description="Columns such as `supply_v` or `power_on_s`, a value for each frame, null where unknown.",
    )
    wearing: WearingName | None = Field(None, description="The donning in which all frames were read.")
    steadied_s: float = Field(
        0.0,
        ge=0.0,
        le=LONGEST_STEADIED_S,
        description="Take the sensors' noise off afterwards, as live poses cannot: each angle is the middle "
        "of a parabola over so many seconds; needs time_s. `sd_deg` stays that of a single frame.",
    )


class Angles(BaseModel):
    model: str
    rotations: list[str]
    mean_deg: list[list[float | None]]
    sd_deg: list[list[float | None]] = Field(description="Of the rotation with its measurement noise.")
    flags: list[list[int]] = Field(
        description="Sum of 1 extrapolating, 2 too uncertain, 4 by rule, 8 faulty sensor (last good angle)."
    )
    effects: list[str] = Field(description="The model's effects that are in these angles.")
    settling_s: float = Field(
        description="So long after the first frame, and after a gap, the effects remember too little."
    )
    sentences: list[str] = Field(description="What is not corrected, for want of context or wearing.")


@router.post(
    "/{id}/predict",
    response_model=Angles,
    summary="Rotations of given readings",
    responses=change_problems(409),
)
def predict(id: ModelInPath, body: Readings, parts: PartsNeeded) -> dict[str, Any]:
    """For trying a model out; the live stream goes over zenoh.

    422 when the sensors are not the model's, and when an effect of the model depends on when the frames were
    read and `time_s` is missing.
    """
    record = parts.store.models.get(id)
    model, predictor = parts.predictors.get(record.id)
    readings = _in_model_order(body, model)
    effects = predictor.stream()
    if effects.needing_time and body.time_s is None:
        raise BadInput(
            f"model {record.id[:12]} has {', '.join(effects.needing_time)}, for which it matters when "
            f"the frames were read: send time_s, seconds for each of the {len(readings)} frames, increasing"
        )
    if body.steadied_s and body.time_s is None:
        raise BadInput("steadied_s needs time_s, seconds for each of the frames, increasing")
    context = _context(body)
    time_s = _time_s(body)
    with parts.predictors.one_at_a_time:
        angles = predictor.predict_take(time_s, readings, context, body.wearing or "")
    known = [name for name, column in context.items() if np.isfinite(column).any()]
    parts.metrics.predicted_frames.inc(len(body.readings))
    return {
        "model": record.id,
        "rotations": list(predictor.rotations),
        "mean_deg": plain(steadied(time_s, angles.mean, body.steadied_s) if body.steadied_s else angles.mean),
        "sd_deg": plain(angles.sd),
        "flags": angles.flags.tolist(),
        "effects": list(effects.names),
        "settling_s": effects.settling_s,
        "sentences": list(effects.silent(known, body.wearing or "")),
    }


def _time_s(body: Readings) -> np.ndarray:
    frames = len(body.readings)
    if body.time_s is None:
        # Nothing that is left looks at it.
        return np.arange(frames) / 100.0
    time_s = np.array(body.time_s, dtype=float)
    if len(time_s) != frames:
        raise BadInput(f"time_s has {len(time_s)} values for {frames} frames; each frame needs one")
    back = np.flatnonzero(np.diff(time_s) <= 0)
    if len(back):
        at = int(back[0])
        raise BadInput(
            f"time_s must increase, but frame {at + 1} is at {time_s[at + 1]:g} s and frame {at} "
            f"at {time_s[at]:g} s"
        )
    return time_s


def _context(body: Readings) -> dict[str, np.ndarray]:
    frames, columns = len(body.readings), body.context or {}
    for name, values in columns.items():
        if len(values) != frames:
            raise BadInput(
                f"context {name} has {len(values)} values for {frames} frames; each frame needs one, or null"
            )
    return {name: np.array(values, dtype=float) for name, values in columns.items()}


def _in_model_order(body: Readings, model: CalibrationModel) -> np.ndarray:
    wanted = model.layout.sensors
    given = tuple(body.sensors) if body.sensors is not None else wanted
    missing = [name for name in wanted if name not in given]
    if missing:
        raise LayoutMismatch(f"no readings of sensor {missing[0]!r}, which the model's layout needs")
    for number, frame in enumerate(body.readings):
        if len(frame) != len(given):
            raise LayoutMismatch(
                f"frame {number} has {len(frame)} readings, but there are {len(given)} sensors: "
                f"{', '.join(given)}"
            )
    return np.array(body.readings, dtype=float)[:, [given.index(name) for name in wanted]]
