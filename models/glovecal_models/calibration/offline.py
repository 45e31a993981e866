"""A take's angles, estimated with what came after each frame too: all of it, or of a stated delay.

Live poses are causal; a recording need not be. What the model says of each frame, its effects with their own
memory included, is the measurement, and the motion is smoothed in both directions of time. A lag's correction
leads the reading frame by frame, and has to weigh what it gains against the noise that it amplifies. With the
future the late reading is smoothed first, and led by the smooth motion's velocity and acceleration; how far
is learned with the effect (``learned_lead``).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from glovecal_models.calibration.added_effect import AddedEffect
from glovecal_models.calibration.correction_parts import CorrectionPart, CorrectionParts
from glovecal_models.calibration.effect_correction import usable_correction
from glovecal_models.calibration.fixed_lag import delayed
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.motion_smoother import SmoothedMotion
from glovecal_models.calibration.predictor import LEAST_VARIANCE, GloveAngles, GlovePredictor
from glovecal_models.effects.base.effect import CorrectionEffect, Late

LEAD = "lead"
"""Where the settings of a late effect keep the ``Lead`` of each rotation."""


@dataclass(frozen=True)
class Lead:
    """How the smoothed motion of a late reading gives the angle of one rotation."""

    offset_deg: float = 0.0
    gain: float = 1.0
    velocity_s: float = 0.0
    """Seconds of the smoothed velocity that are added: the delay of slow motion."""
    acceleration_s2: float = 0.0
    variance: float = 0.0
    """Degrees squared: of a measurement around that, beside what is unknown of the smoothed motion."""

    @property
    def weights(self) -> np.ndarray:
        """(3,) of the smoothed state."""
        return np.array([self.gain, self.velocity_s, self.acceleration_s2])


UNLED = Lead()


class OfflinePredictor(GlovePredictor):
    """Predicts whole takes with both directions of time; single frames as a ``GlovePredictor``."""

    def __init__(self, model: CalibrationModel) -> None:
        super().__init__(model)
        self.smoothing = Smoothing(self, model)

    def predict_take(
        self, time_s: np.ndarray, readings: np.ndarray, context: Mapping[str, np.ndarray], wearing: str
    ) -> GloveAngles:
        """Angles of a whole take (N frames), each estimated from all frames; flags are those of live angles.

        Arguments and errors are those of ``GlovePredictor.predict_take``.
        """
        return self.predict_delayed(time_s, readings, context, wearing, [np.inf])[0]

    def predict_delayed(
        self,
        time_s: np.ndarray,
        readings: np.ndarray,
        context: Mapping[str, np.ndarray],
        wearing: str,
        delays_s: Sequence[float],
    ) -> list[GloveAngles]:
        """As ``predict_take``, once for each of the ``delays_s``: each frame is estimated from those up to so
        many seconds after it, 0 or more; from all of them where that is infinite."""
        base = self.predict(readings)
        if not len(base.mean):
            return [base] * len(delays_s)
        parts = CorrectionParts(*base.mean.shape)
        found = self.stream().of_take(time_s, base.mean, readings, context, wearing, parts)
        live = self.corrected(base, found.degrees, inflation=found.inflation)
        late = self.smoothing.late(live, found.degrees, parts.found)
        motions = delayed(time_s, late.degrees, late.known, delays_s)
        return [self.smoothing.angles(live, late.claimed, motion) for motion in motions]


class Smoothing:
    """What of a model's live angles is smoothed, and the angles of what was."""

    def __init__(self, predictor: GlovePredictor, model: CalibrationModel) -> None:
        names, leads = predictor.rotations, leads_of(model.effects)
        self._rules = predictor.rules
        self._leads = [leads.get(name, UNLED) for name in names]
        self._led = parts_led(model.effects, leads, names)
        self._noise = np.array([item.regressor.noise_variance for item in model.rotations])
        # Of a measurement, at most what takes that were left out show: regressors learn it from samples that
        # are spread evenly over postures, and claim too much of it.
        errors = [item.held_out_rmse_deg for item in model.rotations]
        self._left_out = np.minimum(self._noise, [np.inf if each is None else each**2 for each in errors])
        self._is_led = np.array([name in leads for name in names])
        self._led_variance = np.array([lead.variance for lead in self._leads])

    def late(self, live: GloveAngles, correction: np.ndarray, parts: Sequence[CorrectionPart]) -> LateAngles:
        """Of ``live`` angles with the effects' ``correction`` (N, R) and its ``parts``."""
        return late_angles(live.mean, correction, parts, self._led)

    def angles(self, live: GloveAngles, claimed: np.ndarray, motion: SmoothedMotion) -> GloveAngles:
        """Of the smoothed ``motion`` of late angles that ``claimed`` (N, R); where nothing was measured, the
        ``live`` ones."""
        mean, spread = led_angles(motion, self._leads)
        # Instead of single frames' noise, which a live claim holds, ``spread`` is what is left of it.
        unsmoothed = np.where(self._is_led, self._led_variance, self._left_out - motion.noise)
        other = live.sd**2 - claimed - self._noise
        variance = np.maximum(other + unsmoothed, LEAST_VARIANCE) + spread
        mean = np.where(motion.is_measured, mean, live.mean)
        variance = np.where(motion.is_measured, variance, live.sd**2)
        for row, sources, weights in self._rules:
            mean[:, row] = mean[:, sources] @ weights
            variance[:, row] = variance[:, sources] @ (weights * weights)
        return GloveAngles(mean, np.sqrt(variance), live.flags)


class LateAngles(NamedTuple):
    """What a model says of N frames and R rotations before late readings are led."""

    degrees: np.ndarray
    """(N, R)."""
    known: np.ndarray
    """(N, R): where sensors say it, and no effect that holds the last good angle."""
    claimed: np.ndarray
    """(N, R), degrees squared: what a live claim has for parts that do not count here."""


def late_angles(
    live: np.ndarray, correction: np.ndarray, parts: Sequence[CorrectionPart], led: Mapping[str, np.ndarray]
) -> LateAngles:
    """Of ``live`` angles (N, R) with the usable ``correction`` (N, R); ``led`` by the name of an effect: the
    rotations (R,) on which its correction does not count, because smoothed readings are led instead."""
    usable = usable_correction(correction)
    degrees, known, claimed = live.copy(), usable.copy(), np.zeros_like(live)
    for part in parts:
        if part.kind == "held":
            known &= ~part.acts
            claimed += np.where(part.acts, part.claimed, 0.0)
        elif part.kind == "correction" and part.name in led:
            degrees -= np.where(led[part.name] & usable, part.degrees, 0.0)
            claimed += np.where(led[part.name], part.claimed, 0.0)
    return LateAngles(degrees, known, claimed)


def led_angles(motion: SmoothedMotion, leads: Sequence[Lead]) -> tuple[np.ndarray, np.ndarray]:
    """Angles (N, R), and the variance that is left in them of single frames' noise."""
    weights = np.array([lead.weights for lead in leads])
    offset = np.array([lead.offset_deg for lead in leads])
    return np.einsum("nli,li->nl", motion.state, weights) + offset, motion.variance(weights)


def leads_of(effects: Sequence[AddedEffect]) -> dict[str, Lead]:
    """By rotation. A model that was stored without any keeps its live correction there."""
    return {
        name: Lead(**document)
        for item in effects
        for name, document in item.settings.get(LEAD, {}).items()
        if name in item.active
    }


def parts_led(
    effects: Sequence[AddedEffect], leads: Mapping[str, Lead], rotations: Sequence[str]
) -> dict[str, np.ndarray]:
    """By the name of each late effect the rotations (R,) that are led."""
    is_led = np.array([name in leads for name in rotations], dtype=bool)
    return {item.name: is_led for item in effects if is_late(item)}


def is_late(item: AddedEffect) -> bool:
    effect = item.effect
    return isinstance(effect, CorrectionEffect) and isinstance(effect.dynamics, Late)
