"""The shape a hand is believed to have before its fingertips are looked at, and how firmly.

At rest where nothing is known, else what a calibration says about the whole hand in each frame of a take.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.predictor import BY_RULE, FAULTY_SENSOR, GlovePredictor
from glovecal_models.calibration.samples import require_layout
from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import HAND_ROTATIONS, RULES, completed
from glovecal_models.inverse_kinematics.tip_chains import TipChains
from glovecal_models.takes.take import Take

THUMB_SD_DEG, FINGER_SD_DEG = 15.0, 10.0
"""How far a hand is from its rest where nothing is known: the thumb is the less stiff (section 5.2.2)."""


@dataclass(frozen=True)
class HandShape:
    """N frames of K rotations, each normally distributed by itself (Wang & Neff 2013, equation 4).

    The inverse squares of ``sd_deg`` are the paper's stiffness coefficients.
    """

    rotations: tuple[str, ...]
    centre_deg: np.ndarray
    """(N, K)."""
    sd_deg: np.ndarray
    """(N, K)."""

    def __post_init__(self) -> None:
        shape = np.shape(self.centre_deg)
        if len(shape) != 2 or shape[1] != len(self.rotations) or np.shape(self.sd_deg) != shape:
            raise BadInput(
                f"a hand's shape has angles {shape} and standard deviations {np.shape(self.sd_deg)}, "
                f"expected (N, {len(self.rotations)}) for both"
            )
        if not np.isfinite(self.centre_deg).all() or not (np.asarray(self.sd_deg) > 0).all():
            raise BadInput("a hand's shape needs finite angles and standard deviations above 0 degrees")

    def __len__(self) -> int:
        return len(self.centre_deg)

    @classmethod
    def at_rest(cls, rotations: Sequence[str]) -> HandShape:
        """A relaxed hand: what is left to say without a calibration."""
        rest = completed((), np.empty((1, 0)), rotations)
        firmness = [THUMB_SD_DEG if name.startswith("T") else FINGER_SD_DEG for name in rotations]
        return cls(tuple(rotations), rest, np.array(firmness)[None])

    def misfit(self, angles_deg: np.ndarray) -> np.ndarray:
        """How far hands (N, K) are from this shape, in standard deviations of the whole, (N,)."""
        return np.sqrt((((angles_deg - self.centre_deg) / self.sd_deg) ** 2).sum(axis=1))


RULE_SD_DEG = 4.0
"""How far a person's last joints are from the rule: 2/3 of the bend before them is a mean over people."""
LEAST_SD_DEG = 0.5
"""No calibration is surer than this."""


@dataclass(frozen=True)
class PredictedHand:
    """N frames of all rotations of a hand."""

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


def predicted_hand(
    take: Take, model: CalibrationModel, rotations: Sequence[str] = HAND_ROTATIONS
) -> PredictedHand:
    """Every frame of ``take``, effects included; ``rotations``: those of the skeleton.

    Raises LayoutMismatch where a sensor is missing.
    """
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
        completed(names, angles.mean, rotations),
        np.column_stack([_sd(name, known, len(sd)) for name in rotations]),
        np.column_stack([faulty.get(name, healthy) for name in rotations]),
    )


def _sd(rotation: str, known: dict[str, np.ndarray], frames: int) -> np.ndarray:
    if rotation in known:
        return known[rotation]
    if rotation in RULES:
        followed = [(weight * _sd(name, known, frames)) ** 2 for name, weight in RULES[rotation].items()]
        return np.sqrt(sum(followed) + RULE_SD_DEG**2)
    return np.full(frames, THUMB_SD_DEG if rotation.startswith("T") else FINGER_SD_DEG)
