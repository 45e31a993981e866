"""The calibration model a glove is served with, ready for prediction, and the table of who has which."""

from __future__ import annotations

import timeit
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial

import numpy as np

from glovecal_client.wire.pose import model_bytes
from glovecal_models.calibration.effect_correction import EffectCorrection
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.offline import Smoothing
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.calibration.servable import WearerFit, check_servable
from glovecal_service.incoming.frame_gate import Refusal, Refused

_GROWTH = 1.5
BESIDES_PREDICTION_S = 50e-6
"""What a frame costs beside its prediction: decoding, checking, encoding, publishing."""
CAUTION = 4.0


class Pace:
    """How many frames one turn may hold so that it ends within a time budget.

    A turn costs something, and each of its frames something. How many times as much as was measured, the
    turns teach, from the cautious side: a faster one is believed at once and a slower one little by little,
    for a single slow turn, as when the process was set aside, must not make it skip frames.
    """

    def __init__(self, frame_s: float = 1e-3, turn_s: float = 0.0) -> None:
        self._frame_s, self._turn_s, self._times = frame_s, turn_s, CAUTION

    def observe(self, frames: int, seconds: float) -> None:
        """A turn of ``frames`` took ``seconds``."""
        if frames > 0:
            times = seconds / (self._turn_s + frames * self._frame_s)
            self._times = max(1e-3, min(times, self._times * _GROWTH))

    def frames_within(self, seconds: float) -> int:
        """At least one frame: something must go on."""
        return max(1, int((seconds / self._times - self._turn_s) / self._frame_s))


@dataclass(frozen=True, eq=False)
class ServedModel:
    """A model with everything computed that prediction needs. Gloves of one subject and layout share one."""

    model_id: str
    """sha256, 64 hexadecimal digits."""
    name_in_pose: bytes
    subject: str
    layout: str
    method: str
    simulated: bool
    """The model was trained on simulated takes."""
    sensors: tuple[str, ...]
    """In the order in which the glove sends them."""
    rotations: tuple[str, ...]
    counts: tuple[float, float] | None
    predictor: GlovePredictor
    model: CalibrationModel
    wearer_fit: WearerFit
    effects: tuple[str, ...] = ()
    """Names of the effects that correct the prediction."""
    pace: Pace = field(default_factory=Pace)
    """Belongs to the thread that predicts."""

    @classmethod
    def prepare(cls, model_id: str, model: CalibrationModel) -> ServedModel:
        """Build the predictor and run it a few times, so that the first frame finds it warm.

        Raises BadInput for a model that does not predict.
        """
        check_servable(model)
        predictor = GlovePredictor(model)
        low, high = model.layout.counts or (0.0, 1.0)
        readings = np.full((1 + _MORE, len(model.layout.sensors)), 0.5 * (low + high))
        gloves = [predictor.stream() for _ in readings]
        one, more = (
            min(timeit.repeat(partial(_predict, predictor, gloves[:n], readings[:n]), number=1, repeat=3))
            for n in (1, 1 + _MORE)
        )
        frame_s = max(more - one, 0.0) / _MORE
        return cls(
            model_id=model_id,
            name_in_pose=model_bytes(model_id),
            subject=model.subject,
            layout=model.layout.name,
            method=model.method,
            simulated=model.simulated,
            sensors=model.layout.sensors,
            rotations=tuple(predictor.rotations),
            counts=model.layout.counts,
            predictor=predictor,
            model=model,
            wearer_fit=WearerFit(model, predictor),
            effects=gloves[0].names,
            pace=Pace(frame_s + BESIDES_PREDICTION_S, max(one - frame_s, 0.0)),
        )

    @cached_property
    def smoothing(self) -> Smoothing:
        """For gloves that are served with a delay."""
        return Smoothing(self.predictor, self.model)

    def check_count(self, readings: np.ndarray) -> None:
        """Raise Refused for readings (S,) that are not this layout's."""
        if len(readings) != len(self.sensors):
            raise Refused(
                Refusal.SENSOR_COUNT,
                f"{len(readings)} readings, but layout {self.layout} has {len(self.sensors)} sensors",
            )

    def out_of_range(self, readings: np.ndarray) -> dict[int, Refused]:
        """Why frames must not be predicted, by their rows in ``readings`` (N, S)."""
        if self.counts is None:
            return {}
        low, high = self.counts
        outside = (readings < low) | (readings > high)
        if not outside.any():
            return {}
        return {
            row: Refused(
                Refusal.OUT_OF_RANGE,
                f"{self.sensors[column]} reads {readings[row, column]:g}; "
                f"layout {self.layout} sends {low:g} to {high:g}",
            )
            for row in np.flatnonzero(outside.any(axis=1)).tolist()
            for column in (int(np.argmax(outside[row])),)
        }


_MORE = 15
"""Frames in one turn beside the first, to measure what a frame costs and what a turn does."""


def _predict(predictor: GlovePredictor, gloves: Sequence[EffectCorrection], readings: np.ndarray) -> None:
    """One turn: a frame of each of G gloves, ``readings`` (G, S)."""
    base, count = predictor.predict(readings).mean, len(gloves)
    EffectCorrection.of_frames(gloves, np.zeros(count), base, readings, [{}] * count, [""] * count)


class ServedModels:
    """Which model each glove has. Written by the model watcher, read between frames; a swap is one store."""

    def __init__(self) -> None:
        self._models: dict[str, ServedModel | None] = {}

    def of(self, glove: str) -> ServedModel | None:
        return self._models.get(glove)

    def is_chosen(self, glove: str) -> bool:
        """Whether somebody has looked which model the glove is to have, if only that there is none."""
        return glove in self._models

    def put(self, glove: str, model: ServedModel | None) -> None:
        """Serve ``glove`` with ``model`` from its next frame on; None makes it uncalibrated."""
        self._models[glove] = model

    def forget(self, glove: str) -> None:
        self._models.pop(glove, None)

    def in_use(self) -> dict[tuple[str, tuple[str, ...]], ServedModel]:
        """The prepared models by model id and order of the sensors."""
        models = filter(None, list(self._models.values()))
        return {(model.model_id, model.sensors): model for model in models}
