"""What a calibration says about the whole hand in each frame of a take, and how surely."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.predictor import BY_RULE, FAULTY_SENSOR, GlovePredictor
from glovecal_models.calibration.samples import require_layout
from glovecal_models.hand.rotations import HAND_ROTATIONS, RULES, completed
from glovecal_models.inverse_kinematics.hand_shape import FINGER_SD_DEG, THUMB_SD_DEG, HandShape
from glovecal_models.inverse_kinematics.tip_chains import TipChains
from glovecal_models.takes.take import Take

RULE_SD_DEG = 4.0
"""How far a person's last joints are from the rule: 2/3 of the bend before them is a mean over people."""
LEAST_SD_DEG = 0.5
"""No calibration is surer than this."""


@dataclass(frozen=True)
class PredictedHand:
    """N frames of all ``HAND_ROTATIONS``."""

    mean_deg: np.ndarray
    """(N, R)."""
    sd_deg: np.ndarray
    """(N, R); of what nobody calibrated: as wide as a resting hand, or a rule, may be wrong."""
    is_faulty: np.ndarray
    """(N, R): its sensor fails."""

    def frames(self, chosen: slice) -> PredictedHand:
        """These frames alone."""
        return PredictedHand(self.mean_deg[chosen], self.sd_deg[chosen], self.is_faulty[chosen])

    def shape(self, chains: TipChains) -> HandShape:
        """Of the rotations that move these fingertips."""
        columns = chains.columns
        return HandShape(chains.rotations, self.mean_deg[:, columns], self.sd_deg[:, columns])


def predicted_hand(take: Take, model: CalibrationModel) -> PredictedHand:
    """Every frame of ``take``, effects included. Raises LayoutMismatch where a sensor is missing."""
    require_layout(take, model.layout)
    readings = take.readings[:, [take.sensors.index(name) for name in model.layout.sensors]]
    angles = GlovePredictor(model).predict_take(take.time_s, readings, take.context, take.wearing)
    names = model.rotation_names
    by_rule = (angles.flags & BY_RULE) > 0
    sd = np.where(by_rule, np.hypot(angles.sd, RULE_SD_DEG), np.maximum(angles.sd, LEAST_SD_DEG))
    known = dict(zip(names, sd.T, strict=True))
    faulty = dict(zip(names, ((angles.flags & FAULTY_SENSOR) > 0).T, strict=True))
    healthy = np.zeros(len(sd), dtype=bool)
    return PredictedHand(
        completed(names, angles.mean),
        np.column_stack([_sd(name, known, len(sd)) for name in HAND_ROTATIONS]),
        np.column_stack([faulty.get(name, healthy) for name in HAND_ROTATIONS]),
    )


def _sd(rotation: str, known: dict[str, np.ndarray], frames: int) -> np.ndarray:
    if rotation in known:
        return known[rotation]
    if rotation in RULES:
        followed = [(weight * _sd(name, known, frames)) ** 2 for name, weight in RULES[rotation].items()]
        return np.sqrt(sum(followed) + RULE_SD_DEG**2)
    return np.full(frames, THUMB_SD_DEG if rotation.startswith("T") else FINGER_SD_DEG)
