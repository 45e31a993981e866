"""The clock offset at which a take's reference is nearest to what a model predicts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_models.takes.take import Take

COARSE_S, FINE_S = 0.04, 0.002
LEAST_OVERLAP = 0.6
"""Of the frames that the reference can cover."""


def offset_to(take: Take, rotations: Sequence[str], predicted: np.ndarray, width_s: float) -> float:
    """Seconds, at most ``width_s`` from zero, for the model's angles (N, R) at the frames, degrees."""
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
