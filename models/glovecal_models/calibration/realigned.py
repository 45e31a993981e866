"""A take's reference on the frames' clock, when the model says that the clocks disagree.

A clock offset is repaired in the measurement, never predicted. A common offset found in training is applied
as it is; where each take had its own, it is estimated again for this take, from where the prediction fits.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.effects.base.signature_effect import SignatureEffect
from glovecal_models.effects.delay.clock_scan import aligned
from glovecal_models.takes.take import Take

CLOCK_OFFSET = "clock_offset"
RANGE_S, COARSE_S, FINE_S = 3.0, 0.04, 0.002
NEAR_S = 0.3
"""When training's offsets all lie within this, so will this take's."""
LEAST_OVERLAP = 0.6
"""Of the frames that the reference can cover."""


def realigned(model: CalibrationModel, take: Take, predicted: np.ndarray) -> Take:
    """``predicted`` (N, R): the model's angles at the frames, degrees."""
    added = next((item for item in model.effects if item.name == CLOCK_OFFSET), None)
    if added is None or len(take.reference_time_s) < 2:
        return take
    offsets = {str(name): float(value) for name, value in added.settings["offset_s"].items()}
    if not added.settings["per_take"]:
        return aligned(take, float(added.settings["common_s"]))
    if take.name in offsets:
        return aligned(take, offsets[take.name])
    largest = max((abs(value) for value in offsets.values()), default=NEAR_S)
    width = NEAR_S if largest < 0.5 * NEAR_S else RANGE_S
    return aligned(take, offset_of(take, model.rotation_names, predicted, width))


def usable(model: CalibrationModel, take: Take) -> Take:
    """The take without what the model's effects say is no measurement: repeated frames, faulty pieces."""
    for item in model.effects:
        if item.name != CLOCK_OFFSET and item.effect.side == "reference":
            found = item.effect
            if isinstance(found, SignatureEffect):
                take = found.repaired([take])[0]
    return take


def offset_of(take: Take, rotations: tuple[str, ...], predicted: np.ndarray, width_s: float) -> float:
    """The offset (s) at which the reference is nearest to ``predicted`` (N, R)."""
    columns = [(take.rotations.index(name), i) for i, name in enumerate(rotations) if name in take.rotations]
    scale = np.maximum(np.nanstd(take.reference, axis=0), 1.0)

    measured_s = float(take.reference_time_s[-1] - take.reference_time_s[0])
    least = LEAST_OVERLAP * min(1.0, measured_s / max(take.duration_s, 1e-9))

    def misfit(offset_s: float) -> float:
        at = take.time_s + offset_s
        inside = (at >= take.reference_time_s[0]) & (at <= take.reference_time_s[-1])
        if inside.mean() < least:
            return np.inf
        total = []
        for column, row in columns:
            known = np.isfinite(take.reference[:, column])
            if known.sum() > 1:
                values = np.interp(at[inside], take.reference_time_s[known], take.reference[known, column])
                total.append(np.mean((values - predicted[inside, row]) ** 2) / scale[column] ** 2)
        return float(np.mean(total)) if total else np.inf

    coarse = np.arange(-width_s, width_s + COARSE_S / 2, COARSE_S)
    best = float(coarse[int(np.argmin([misfit(offset) for offset in coarse]))])
    fine = np.arange(best - COARSE_S, best + COARSE_S + FINE_S / 2, FINE_S)
    return float(fine[int(np.argmin([misfit(offset) for offset in fine]))])
