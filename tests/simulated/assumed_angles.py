"""Angles by the assumed processes: what the samples say when no hyperparameter is learned from them.

The mean that belongs to ``PosteriorVariance``. With the few samples of a beginning it may be nearer the truth
than a trained process, whose hyperparameters follow the steps' own errors.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import block_diag

from glovecal_models.layout import Correspondence, Layout
from glovecal_models.sampling.active.known_readings import KnownReadings
from glovecal_models.sampling.active.proposal import AssumedProcess, assumed_process, sampled_points


def assumed_angles(layout: Layout, known: KnownReadings, readings: np.ndarray) -> dict[str, np.ndarray]:
    """Degrees (N,) by rotation that ``known`` has samples of, at ``readings`` (N, S), counts."""
    measured = {rotation for block in known.blocks for rotation in block.angles}
    angles = {}
    for item in layout.correspondences:
        if item.simulated is None and item.rotation in measured:
            process = assumed_process(item, known.low, known.high, known.sensors)
            angles[item.rotation] = _mean(process, item, known, readings)
    return angles


def _mean(
    process: AssumedProcess, item: Correspondence, known: KnownReadings, readings: np.ndarray
) -> np.ndarray:
    sampled = [sampled_points(block, item, process, known.sensors) for block in known.blocks]
    points = np.concatenate([each.points for each in sampled])
    target = np.concatenate([each.target for each in sampled])
    matrix = process.between(points, points) + block_diag(*(each.errors for each in sampled))
    middle = float(target.mean())
    weights = np.linalg.solve(matrix, target - middle)
    return (
        middle + process.between(process.unit(item.input_columns(readings, known.sensors)), points) @ weights
    )
