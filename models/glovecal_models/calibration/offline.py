"""A whole take's angles, estimated with what came after each frame too.

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
from glovecal_models.calibration.motion_smoother import SmoothedMotion, smoothed
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

    def predict_take(
        self, time_s: np.ndarray, readings: np.ndarray, context: Mapping[str, np.ndarray], wearing: str
    ) -> GloveAngles:
        """Angles of a whole take (N frames), each estimated from all frames; flags are those of live angles.

        Arguments and errors are those of ``GlovePredictor.predict_take``.
        """
        base = self.predict(readings)
        if not len(base.mean):
            return base
        parts, leads = CorrectionParts(*base.mean.shape), leads_of(self._model.effects)
        found = self.stream().of_take(time_s, base.mean, readings, context, wearing, parts)
        live = self.corrected(base, found.degrees, inflation=found.inflation)
        names = self.rotations
        led = parts_led(self._model.effects, leads, names)
        late = late_angles(live.mean, found.degrees, parts.found, led)
        motion = smoothed(time_s, late.degrees, late.known)
        each = [leads.get(name, UNLED) for name in names]
        mean, spread = led_angles(motion, each)
        # Instead of single frames' noise, which a live claim holds, ``spread`` is what is left of it.
        learned = np.array([name in leads for name in names])
        unsmoothed = np.where(learned, [lead.variance for lead in each], self._left_out() - motion.noise)
        other = live.sd**2 - late.claimed - self._noise[:, 0]
        variance = np.maximum(other + unsmoothed, LEAST_VARIANCE) + spread
        for row, sources, weights in self.rules:
            mean[:, row] = mean[:, sources] @ weights
            variance[:, row] = variance[:, sources] @ (weights * weights)
        return GloveAngles(mean, np.sqrt(variance), live.flags)

    def _left_out(self) -> np.ndarray:
        """(R,), degrees squared: noise of a measurement, at most what takes that were left out show.

        Regressors learn it from samples that are spread evenly over postures, and claim too much of it.
        """
        errors = [item.held_out_rmse_deg for item in self._model.rotations]
        return np.minimum(self._noise[:, 0], [np.inf if error is None else error**2 for error in errors])


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
