"""One frame's prediction, written down on its way because somebody asked what its angles are made of.

The thread that predicts only keeps what it has at hand anyway; whoever asked puts it together.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from threading import Event

import numpy as np

from glovecal_client.wire.frame import Frame
from glovecal_models.calibration.answer import FrameExplanation
from glovecal_models.calibration.correction_parts import CorrectionParts
from glovecal_models.calibration.effect_correction import EffectCorrection
from glovecal_models.calibration.explanation import PredictedFrame, explained
from glovecal_models.calibration.predictor import GloveAngles
from glovecal_service.realtime.served_model import ServedModel


@dataclass(frozen=True)
class Effects:
    """What a model's effects did with one frame."""

    correction: np.ndarray
    """(1, R), degrees."""
    parts: CorrectionParts
    """Of this frame alone."""
    stream: EffectCorrection
    context: Mapping[str, float]
    wearing: str
    since_start_s: float


class FrameRecord:
    """Given to a lane; filled by the thread that predicts, which forgets it with the frame it served."""

    def __init__(self) -> None:
        self.is_served = Event()
        self.model: ServedModel | None = None
        self.frame: Frame | None = None
        self._readings = np.empty(0)
        self._base: GloveAngles | None = None
        self._angles: GloveAngles | None = None
        self._effects: Effects | None = None

    def predicted(
        self,
        model: ServedModel,
        frame: Frame,
        readings: np.ndarray,
        base: GloveAngles,
        effects: Effects | None,
    ) -> None:
        """``readings`` (S,) became ``base``; ``effects`` is None for a model without any."""
        self.model, self.frame = model, frame
        self._readings, self._base, self._effects = readings, base, effects

    def is_of(self, frame: Frame) -> bool:
        return self.frame is frame

    def served(self, angles: GloveAngles) -> None:
        """The pose that was published, before it was rounded for the wire."""
        self._angles = angles
        self.is_served.set()

    def explanation(self) -> FrameExplanation:
        """For another thread, once ``is_served``."""
        model, frame, base, angles, effects = self.model, self.frame, self._base, self._angles, self._effects
        if model is None or frame is None or base is None or angles is None:
            raise RuntimeError("asked for an explanation before the frame was served")
        if effects is None:
            nothing = CorrectionParts(1, len(model.rotations))
            told = (np.zeros_like(base.mean), nothing, 0.0, 0.0, ())
        else:
            known = [name for name, value in effects.context.items() if np.isfinite(value)]
            told = (
                effects.correction, effects.parts, effects.since_start_s, effects.stream.settling_s,
                effects.stream.silent(known, effects.wearing),
            )  # fmt: skip
        time_s = frame.monotonic_ns / 1e9
        return explained(
            model.model, model.predictor, PredictedFrame(time_s, self._readings, base, angles, *told)
        )
